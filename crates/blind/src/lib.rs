//! The check on withheld data.
