//! Declares a set of commands for clap.

/// Declares the modules, and an enum with one variant for each `module::Options`, whose help is their documentation; its
/// `run` runs the one that was asked for.
macro_rules! subcommands {
    ($name:ident: $($module:ident::$options:ident),+ $(,)?) => {
        $(mod $module;)+

        /// One variant a command.
        #[derive(Debug, clap::Subcommand)]
        pub enum $name {
            $(
                #[allow(missing_docs, reason = "a variant's documentation would replace that of its options in the help")]
                $options($module::$options),
            )+
        }

        impl $name {
            /// Runs the selected command.
            pub fn run(&self) -> Result<(), Failure> {
                match self {
                    $($name::$options(options) => options.run(),)+
                }
            }
        }
    };
}

pub(crate) use subcommands;
