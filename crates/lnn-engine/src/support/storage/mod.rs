//! Files read within limits and written whole or not at all; locks of directories; available memory and threads.

#[cfg(feature = "model-files")]
pub mod container;
mod files;
mod lock;
mod machine;

pub use files::{
    AtomicWriter, Disk, Files, ReadError, check_target, open_regular, read_regular, remove_leftovers, replace,
    write_atomically, write_new, write_whole,
};
pub use lock::{Acquired, DirectoryLock, LockOwner};
pub use machine::available_memory;
pub use machine::{MOST_THREADS, in_order};
