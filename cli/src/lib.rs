//! The commands of the `mba` program as a library, so that tests can call them without a process.
