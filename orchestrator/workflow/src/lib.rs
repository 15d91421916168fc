//! YAML -> resolved workflow. Every error has file, line, column, the value, what was expected and the
//! nearest valid name; all errors of a pass are reported together.

pub mod resolved;
