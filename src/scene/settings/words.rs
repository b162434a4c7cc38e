//! Settings whose value is one of a few words.

/// A choice between words of a scene file.
pub trait Words: Copy + PartialEq + Sized + 'static {
    /// The words, in the order in which they are listed.
    const WORDS: &'static [&'static str];
    /// The choices that the words stand for, in the same order.
    const ALL: &'static [Self];

    /// The word for this choice.
    fn word(self) -> &'static str {
        let at = Self::ALL.iter().position(|choice| *choice == self);
        Self::WORDS[at.expect("every choice has its word")]
    }

    /// The choice that a word stands for.
    fn of(word: &str) -> Option<Self> {
        let at = Self::WORDS.iter().position(|known| *known == word)?;
        Some(Self::ALL[at])
    }
}

/// Declares an enum with the word of a scene file for each variant.
macro_rules! words {
    ($(#[$meta:meta])* pub enum $name:ident {
        $($(#[$variant_meta:meta])* $variant:ident = $word:literal),+ $(,)?
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name {
            $($(#[$variant_meta])* $variant,)+
        }

        impl $crate::settings::Words for $name {
            const WORDS: &'static [&'static str] = &[$($word),+];
            const ALL: &'static [Self] = &[$(Self::$variant),+];
        }

        impl $crate::settings::Field for $name {
            fn get(&self) -> $crate::settings::Value {
                $crate::settings::Value::Word($crate::settings::Words::word(*self))
            }

            fn set(&mut self, value: &$crate::settings::Value) {
                if let $crate::settings::Value::Word(word) = value
                    && let Some(choice) = <Self as $crate::settings::Words>::of(word)
                {
                    *self = choice;
                }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str($crate::settings::Words::word(*self))
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let words = <Self as $crate::settings::Words>::WORDS;
                let form = $crate::settings::Form::Words(words);
                let value = serde::de::DeserializeSeed::deserialize(&form, deserializer)?;
                let mut out = <Self as $crate::settings::Words>::ALL[0];
                $crate::settings::Field::set(&mut out, &value);
                Ok(out)
            }
        }
    };
}
pub(crate) use words;
