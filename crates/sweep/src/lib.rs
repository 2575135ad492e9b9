//! Placeholder head: replaced when the crate gets its content.
