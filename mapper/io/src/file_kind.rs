//! What something in a file system is.

use std::fs::FileType;

/// What something in a file system is, in a word.
pub(crate) fn kind_of(file_type: FileType) -> &'static str {
    if file_type.is_dir() {
        return "folder";
    }
    if file_type.is_symlink() {
        return "link";
    }
    special_kind(file_type)
}

#[cfg(unix)]
fn special_kind(file_type: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    if file_type.is_fifo() {
        "pipe"
    } else if file_type.is_socket() {
        "socket"
    } else if file_type.is_block_device() {
        "disk"
    } else if file_type.is_char_device() {
        "device"
    } else {
        "file"
    }
}

#[cfg(not(unix))]
fn special_kind(_: FileType) -> &'static str {
    "file"
}
