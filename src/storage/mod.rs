//! Files read within limits and written whole or not at all; locks of directories; memory that is left.

#[cfg(feature = "model-files")]
pub mod container;
mod files;
mod lock;
mod memory;
mod read;
mod write;

pub use files::{Disk, Files};
pub use lock::{Acquired, DirectoryLock, LockOwner};
pub use memory::available_memory;
pub use read::{ReadError, open_regular, read_regular};
pub use write::{Growing, check_target, remove_leftovers, replace, write_atomically, write_whole};
