//! Enums with codes or names, the same in files, on the command line and in messages.

use schemars::Schema;
use serde_json::{Value, json};

/// Declares an enum of warnings or remarks. In JSON a variant has the key `code` and its values; readers ignore a `message`.
#[macro_export]
macro_rules! coded_enum {
    (
        $(#[doc = $of:literal])* $enum:ident {
            $($(#[doc = $doc:literal])* $code:literal $name:ident $({ $($field:ident: $type:ty),* })? $(($inner:ty))?,)*
        }
    ) => {
        $(#[doc = $of])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(tag = "code")]
        #[allow(missing_docs, reason = "the fields' names are their quantities and units")]
        #[non_exhaustive]
        pub enum $enum {
            $($(#[doc = $doc])* #[serde(rename = $code)] $name $({ $($field: $type),* })? $(($inner))?,)*
            /// An entry of a file without values, or of another version.
            #[serde(untagged)]
            Other { code: String, #[serde(default)] message: String },
        }

        impl $enum {
            /// All codes, in the order of the reference.
            pub const CODES: &[&str] = &[$($code),*];

            /// The stable code, for machines.
            pub fn code(&self) -> &str {
                match self {
                    $($enum::$name { .. } => $code,)*
                    $enum::Other { code, .. } => code,
                }
            }
        }
    };
}
#[doc(inline)]
pub(crate) use coded_enum;

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

/// Turns the schema of an enum of unit variants into one list of names. `schemars` makes a list of alternatives if each variant has a doc comment;
/// messages could then not list the names together.
pub(crate) fn flatten_to_names(schema: &mut Schema) {
    let Some(Value::Array(variants)) = schema.get("oneOf") else { return };
    let names: Option<Vec<Value>> = variants
        .iter()
        .map(|variant| variant.get("const").or_else(|| variant.get("enum")?.get(0)).cloned())
        .collect();
    if let Some(names) = names {
        schema.remove("oneOf");
        schema.insert("type".to_owned(), json!("string"));
        schema.insert("enum".to_owned(), Value::Array(names));
    }
}
