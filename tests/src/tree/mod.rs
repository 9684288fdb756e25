//! The source tree as the rules see it: packages, their production files, and the modules that name each other.

mod files;
mod modules;
mod parsed;

pub use files::{Package, packages, production_lines};
pub use modules::{Circle, circles, circles_below};
