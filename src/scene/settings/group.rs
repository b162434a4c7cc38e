//! Groups of settings, declared with their rows.

/// Declares the settings of a table, each field with its row. The fields of `beside` are no keys of their own;
/// the rows of `last` are those of keys that have no field.
macro_rules! group {
    ($(#[$meta:meta])* pub struct $name:ident in $table:literal {
        $($(#[doc = $doc:literal])+ $field:ident: $type:ty = $default:expr, $facts:expr;)*
    } $(beside { $($(#[doc = $other_doc:literal])+ $other:ident: $other_type:ty = $other_default:expr;)* })?
    ) => {
        $crate::settings::group! {
            $(#[$meta])* pub struct $name in $table, from files {
                $($(#[doc = $doc])+ $field: $type, $facts;)*
            } $(beside { $($(#[doc = $other_doc])+ $other: $other_type;)* })?
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* $($($other: $other_default,)*)? }
            }
        }
    };
    ($(#[$meta:meta])* pub struct $name:ident in $table:literal, from files {
        $($(#[doc = $doc:literal])+ $field:ident: $type:ty, $facts:expr;)*
    } $(beside { $($(#[doc = $other_doc:literal])+ $other:ident: $other_type:ty;)* })?
      $(last $last:expr)?
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name {
            $($(#[doc = $doc])+ pub $field: $type,)*
            $($($(#[doc = $other_doc])+ pub $other: $other_type,)*)?
        }

        impl $crate::settings::Group for $name {
            const TABLE: &'static str = $table;

            fn rows() -> &'static [$crate::settings::Row<Self>] {
                use $crate::settings::{Facts, Field, Row};
                static ROWS: std::sync::LazyLock<Vec<Row<$name>>> = std::sync::LazyLock::new(|| {
                    let rows = vec![$(Row {
                        facts: {
                            const FACTS: Facts = $facts;
                            FACTS.named(stringify!($field), concat!($($doc),+))
                        },
                        get: |from: &$name| from.$field.get(),
                        set: |to: &mut $name, value| to.$field.set(value),
                    }),*];
                    rows.into_iter()$(.chain($last))?.collect()
                });
                &ROWS
            }
        }
    };
}
pub(crate) use group;
