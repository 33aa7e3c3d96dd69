//! Files of other formats, recognised by their first bytes.

use super::Problem;

/// Bytes at the beginning of a file that are examined.
pub const LOOKED_AT: u64 = 520;

/// How to convert workbooks and frames to a readable file.
const SAVE_AS: &str = "save the sheet as .xlsx, or as CSV: File, Save As, CSV UTF-8";
const FRAME: &str = "in Python write pandas.DataFrame(..).to_csv('motion.csv', index=False), or give the frame to the Python package lnn";
const PANDAS: &str =
    "in Python give pandas.read_parquet('FILE') to lnn.fit as it is, or write .to_csv('motion.csv', index=False)";
const ARROW: &str =
    "in Python give pandas.read_feather('FILE') to lnn.fit as it is, or write .to_csv('motion.csv', index=False)";
const MATLAB: &str = "in MATLAB write writetable(table(t, q1, q2), 'motion.csv'); in Python scipy.io.loadmat('FILE') and \
                      numpy.savez('motion.npz', t=t, q1=q1, q2=q2)";
const HDF5: &str = "in MATLAB write writetable(table(t, q1, q2), 'motion.csv'); in Python open it with h5py and write \
                    numpy.savez('motion.npz', t=t, q1=q1, q2=q2)";
const UNPACK: &str = "unpack it first";

/// Offset and bytes that identify a format, its name, and the advice.
const FORMATS: [(usize, &[u8], &str, &str); 14] = [
    (0, b"MATLAB 5.0 MAT-file", "a MATLAB file", MATLAB),
    (0, b"MATLAB 7.3 MAT-file", "a MATLAB file of version 7.3", HDF5),
    (0, b"\x89HDF\r\n\x1a\n", "an HDF5 file", HDF5),
    (512, b"\x89HDF\r\n\x1a\n", "an HDF5 file", HDF5),
    (0, b"PAR1", "a Parquet file", PANDAS),
    (0, b"ARROW1", "an Arrow file", ARROW),
    (0, b"FEA1", "a Feather file", ARROW),
    (0, b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Excel workbook (.xls)", SAVE_AS),
    (0, b"\x28\xb5\x2f\xfd", "a file packed by zstd", UNPACK),
    (0, b"\xfd7zXZ\0", "a file packed by xz", UNPACK),
    (0, b"BZh", "a file packed by bzip2", UNPACK),
    (0, b"#ROSBAG", "a ROS bag", "write its topic as CSV: rostopic echo -b FILE -p /TOPIC > motion.csv"),
    (0, b"SQLite format 3\0", "an SQLite database", FRAME),
    (0, b"\x80\x04\x95", "a pickle of Python", FRAME),
];

/// Rejects a file that begins with the magic bytes of a foreign format.
pub fn refuse(start: &[u8]) -> Result<(), Problem> {
    let found = FORMATS.iter().find(|(at, mark, ..)| start.get(*at..).is_some_and(|from| from.starts_with(mark)));
    found.map_or(Ok(()), |&(.., name, help)| Err(Problem::Foreign { name, help }))
}

/// Identifies an archive that does not contain arrays, by its entries.
pub fn archive<'a>(mut names: impl Iterator<Item = &'a str>) -> Option<Problem> {
    let (name, help) = names.find_map(|name| match name {
        "content.xml" => Some(("an OpenDocument sheet (.ods)", SAVE_AS)),
        "xl/workbook.bin" => Some(("a binary Excel workbook (.xlsb)", SAVE_AS)),
        _ if name.ends_with(".csv") || name.ends_with(".txt") => Some(("a ZIP archive of text", UNPACK)),
        _ => None,
    })?;
    Some(Problem::Foreign { name, help })
}
