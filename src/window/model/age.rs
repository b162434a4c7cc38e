//! The age of something in words.

use std::time::Duration;

/// An age as text - seconds up to a minute, then minutes, then hours - and the time after which the
/// text changes.
pub fn age(age: Duration) -> (String, Duration) {
    let seconds = age.as_secs();
    let (unit, word) = match seconds {
        0..60 => (1, "s"),
        60..3600 => (60, "min"),
        _ => (3600, "h"),
    };
    let next = Duration::from_secs((seconds / unit + 1) * unit);
    (format!("{} {word}", seconds / unit), next - age)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::age;

    #[test]
    fn an_age_reads_differently_exactly_when_it_says() {
        for (ms, words) in [
            (0, "0 s"),
            (999, "0 s"),
            (1000, "1 s"),
            (59_999, "59 s"),
            (60_000, "1 min"),
            (3_599_999, "59 min"),
            (3_600_000, "1 h"),
            (7_199_999, "1 h"),
        ] {
            let now = Duration::from_millis(ms);
            let (text, rest) = age(now);
            assert_eq!(text, words);
            assert_eq!(age(now + rest - Duration::from_nanos(1)).0, words);
            assert_ne!(age(now + rest).0, words, "{ms}");
        }
    }
}
