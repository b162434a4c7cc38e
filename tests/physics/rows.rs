//! The validation table: every check once, for the tests and for the report.

use crate::check::Check;

macro_rules! rows {
    ($($module:ident::$name:ident),* $(,)?) => {
        /// All checks, in the order of the table.
        pub fn all() -> Vec<Check> {
            vec![$(crate::$module::$name()),*]
        }

        #[cfg(test)]
        mod proofs {
            $(#[test]
            fn $name() {
                let check = crate::$module::$name();
                assert_eq!(check.name, stringify!($name));
                crate::check::prove(&check);
            })*
        }
    };
}

rows! {
    timing::a_plate_shows_at_its_time_of_flight,
}
