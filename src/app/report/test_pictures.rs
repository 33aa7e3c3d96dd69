//! Pictures of tests.

use super::Figure;

/// Keeps pictures to look at in the directory that `LNN_TEST_PICTURES` names.
pub fn save(figures: &[Figure]) {
    if let Ok(directory) = std::env::var("LNN_TEST_PICTURES") {
        for figure in figures {
            std::fs::write(std::path::Path::new(&directory).join(&figure.file), figure.picture.to_svg()).unwrap();
        }
    }
}
