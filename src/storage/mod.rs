//! Files read within limits and written whole or not at all; claims of directories; memory that is left.

mod claim;
#[cfg(feature = "model-files")]
pub mod container;
mod files;
mod lock_owner;
mod memory;
mod read;
mod write;

pub use claim::{Claim, Claimant, Holder, Standing, Taken};
pub use files::{Disk, Files};
pub use lock_owner::LockOwner;
pub use memory::available_memory;
pub use read::{ReadError, open_regular, read_regular};
pub use write::{Growing, check_target, remove_leftovers, replace, write_atomically, write_whole};
