//! Names of files that are free.

/// `STEM.ENDING`, or the first of `STEM-2.ENDING`, `STEM-3.ENDING`, ... that is not `taken`.
pub fn free(stem: &str, ending: &str, taken: impl Fn(&str) -> bool) -> String {
    let mut name = format!("{stem}.{ending}");
    for number in 2.. {
        if !taken(&name) {
            break;
        }
        name = format!("{stem}-{number}.{ending}");
    }
    name
}

#[cfg(test)]
mod tests {
    use super::free;

    #[test]
    fn the_first_number_that_is_free_is_taken() {
        let taken = ["a.obj", "a-2.obj", "b-2.obj"];
        let of = |stem| free(stem, "obj", |name| taken.contains(&name));
        assert_eq!(["a", "b", "c"].map(of), ["a-3.obj", "b.obj", "c.obj"]);
    }
}
