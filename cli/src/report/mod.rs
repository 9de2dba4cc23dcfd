//! Results for people: tables in the terminal.

pub mod table;
