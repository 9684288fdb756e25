//! Enums of plain variants, each with one name: in files, on the command line and in messages.

/// A name that no variant has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{name}` is not one of {}", .known.join(", "))]
pub struct UnknownName {
    /// The given name.
    pub name: String,
    /// The names.
    pub known: &'static [&'static str],
}

/// Declares an enum whose variants have names.
///
/// ```
/// mapper_core::named_enum! {
///     /// Air on or off.
///     pub enum Air {
///         /// On.
///         On = "on",
///         /// Off.
///         Off = "off",
///     }
/// }
/// assert_eq!((Air::ALL, "off".parse()), ([Air::On, Air::Off], Ok(Air::Off)));
/// assert_eq!("no".parse::<Air>().unwrap_err().to_string(), "`no` is not one of on, off");
/// assert_eq!(serde_json::to_value(Air::On).unwrap(), Air::On.name());
/// ```
#[macro_export]
macro_rules! named_enum {
    (
        $(#[$meta:meta])* $vis:vis enum $enum:ident {
            $($(#[$variant_meta:meta])* $variant:ident = $name:literal,)+
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
        $vis enum $enum {
            $($(#[$variant_meta])* #[serde(rename = $name)] $variant,)+
        }

        impl $enum {
            /// All of them, in order.
            $vis const ALL: [$enum; [$($name),+].len()] = [$($enum::$variant),+];

            /// Name in files, on the command line and in messages.
            $vis fn name(self) -> &'static str {
                match self {
                    $($enum::$variant => $name,)+
                }
            }
        }

        impl std::fmt::Display for $enum {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }

        impl std::str::FromStr for $enum {
            type Err = $crate::UnknownName;

            fn from_str(name: &str) -> Result<Self, $crate::UnknownName> {
                let known = || $crate::UnknownName { name: name.to_owned(), known: &[$($name),+] };
                $enum::ALL.into_iter().find(|variant| variant.name() == name).ok_or_else(known)
            }
        }
    };
}
#[doc(inline)]
pub(crate) use named_enum;
