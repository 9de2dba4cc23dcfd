//! Tests of whole sequences.
