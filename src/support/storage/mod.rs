//! Files read within limits and written whole or not at all; locks of directories; memory and threads that the machine gives.

#[cfg(feature = "model-files")]
pub mod container;
mod files;
mod lock;
mod memory;
mod threads;
mod write;

pub use files::{Disk, Files};
pub use files::{ReadError, open_regular, read_regular};
pub use lock::{Acquired, DirectoryLock, LockOwner};
pub use memory::available_memory;
pub(crate) use threads::{MOST_THREADS, in_order};
pub use write::{Growing, check_target, remove_leftovers, replace, write_atomically, write_whole};
