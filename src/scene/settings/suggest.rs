//! "Did you mean": the nearest name, or the list where nothing is near.

/// The name most like `wrong`, if it is likely to be meant.
pub fn nearest<'a>(wrong: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    names
        .map(|name| {
            let distance = strsim::damerau_levenshtein(
                &wrong.to_lowercase().replace('-', "_"),
                &name.to_lowercase(),
            );
            (distance, name)
        })
        .min_by_key(|&(distance, _)| distance)
        // A third of the letters may be wrong, and two always.
        .filter(|&(distance, name)| distance <= (name.len() / 3).max(2) && distance < name.len())
        .map(|(_, name)| name)
}

/// Advice that names the nearest of `names`, or all of them.
pub fn among<'a>(wrong: &str, names: impl Iterator<Item = &'a str> + Clone) -> String {
    if let Some(name) = nearest(wrong, names.clone()) {
        return format!("did you mean `{name}`?");
    }
    let list: Vec<_> = names.map(|n| format!("`{n}`")).collect();
    match list.len() {
        0 => "there is none to choose from".to_owned(),
        _ => format!("choose one of {}", list.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_names_are_found_and_far_ones_are_not_invented() {
        let names = ["muscle", "fetal_bone", "fat"];
        assert_eq!(nearest("muslce", names.into_iter()), Some("muscle"));
        assert_eq!(nearest("Fetal-Bone", names.into_iter()), Some("fetal_bone"));
        assert_eq!(nearest("kryptonite", names.into_iter()), None);
        assert!(among("kryptonite", names.into_iter()).contains("`fat`"));
    }
}
