//! All integration tests of `mapper-validation`: one program, since each further one would be compiled and linked by itself.

mod blind;
mod healthy;
