//! Enums of warnings and remarks: each variant has a stable code and its values; `mapper-report` turns them into sentences.

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
