//! Services of the standard library, and replacements without it: locks, lazily made values, maps, functions of floats.
//!
//! With the feature `std` these are the standard library's own. Without it locks spin, maps are ordered, and functions of floats are those of `libm`.

#[cfg(feature = "std")]
pub use with_std::*;
#[cfg(not(feature = "std"))]
pub use without_std::*;

#[cfg(feature = "std")]
mod with_std {
    use core::hash::{BuildHasherDefault, Hasher};
    use std::collections::HashMap;
    use std::sync::PoisonError;
    pub use std::sync::{Mutex, MutexGuard, OnceLock};

    /// The guard of a lock, of one too whose holder panicked.
    pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
        mutex.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A map whose keys may come from a user: its hash resists collisions that are made on purpose.
    pub type Map<K, V> = HashMap<K, V>;

    /// A map with small numbers as keys, which no user chooses, under a faster hash.
    pub type SmallKeyMap<K, V> = HashMap<K, V, BuildHasherDefault<Mixer>>;

    /// Mixes the words of a key by products.
    #[derive(Debug, Default)]
    pub struct Mixer(u64);

    impl Hasher for Mixer {
        fn write(&mut self, bytes: &[u8]) {
            bytes.iter().for_each(|&byte| self.write_u64(u64::from(byte)));
        }
        fn write_u32(&mut self, word: u32) {
            self.write_u64(u64::from(word));
        }
        fn write_u64(&mut self, word: u64) {
            // An odd number without a pattern, from the golden ratio.
            self.0 = (self.0.rotate_left(23) ^ word).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        }
        fn write_isize(&mut self, word: isize) {
            self.write_u64(word as u64);
        }
        fn finish(&self) -> u64 {
            self.0 ^ (self.0 >> 32)
        }
    }
}

#[cfg(not(feature = "std"))]
mod without_std {
    use alloc::collections::BTreeMap;
    pub use spin::{Mutex, MutexGuard};

    /// The guard of a lock.
    pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
        mutex.lock()
    }

    /// A value that is made on first use.
    #[derive(Debug)]
    pub struct OnceLock<T>(spin::Once<T>);

    impl<T> OnceLock<T> {
        /// No value yet.
        pub const fn new() -> Self {
            Self(spin::Once::new())
        }
        /// Returns the value, which `make` creates on first use.
        pub fn get_or_init(&self, make: impl FnOnce() -> T) -> &T {
            self.0.call_once(make)
        }
    }
    impl<T: Clone> Clone for OnceLock<T> {
        fn clone(&self) -> Self {
            Self(self.0.get().map_or_else(spin::Once::new, |value| spin::Once::initialized(value.clone())))
        }
    }

    /// A map.
    pub type Map<K, V> = BTreeMap<K, V>;

    /// The same map.
    pub type SmallKeyMap<K, V> = BTreeMap<K, V>;
}

/// `float!(f64, sqrt(x))` is `<f64>::sqrt(x)`, a method that without the standard library `f64` does not have.
#[cfg(feature = "std")]
macro_rules! float {
    ($float:ty, $name:ident($($x:expr),*)) => {
        <$float>::$name($($x),*)
    };
}
#[cfg(not(feature = "std"))]
macro_rules! float {
    ($float:ty, $name:ident($($x:expr),*)) => {
        <$float as num_traits::Float>::$name($($x),*)
    };
}
pub(crate) use float;
