use super::*;
use crate::recording::Rows;
use proptest::prelude::*;
use std::fmt::Write as _;
use std::io::Write as _;

pub fn list(names: &str) -> Vec<String> {
    names.split(',').filter(|name| !name.is_empty()).map(str::to_string).collect()
}

pub fn coordinates(names: &str) -> Columns {
    Columns { coords: list(names), ..Columns::default() }
}

fn file(name: &str, content: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    (folder, path)
}

pub fn read(content: impl AsRef<[u8]>, columns: &Columns) -> Result<LoadedRecording, DataError> {
    let (_folder, path) = file("data", content.as_ref());
    LoadedRecording::read(&[path], columns)
}

pub fn refusal(content: impl AsRef<[u8]>, columns: &Columns) -> String {
    let text = read(content, columns).unwrap_err().to_string();
    text.split_once("data: ").map_or(text.clone(), |(_, problem)| problem.to_string())
}

/// `header`, then rows `k, k^2, -k` at times `k / 10`, with some rows replaced.
pub fn table(header: &str, rows: usize, replaced: &[(usize, &str)]) -> String {
    let mut text = format!("{header}\n");
    for k in 0..rows {
        match replaced.iter().find(|(at, _)| *at == k) {
            Some((_, line)) => text += line,
            None => write!(text, "{},{},{}", k as f64 / 10.0, k * k, -(k as f64)).unwrap(),
        }
        text += "\n";
    }
    text
}

#[test]
fn columns_are_found_by_name_and_number() {
    let text = table("t,q1,q2", 20, &[]);
    let all = read(&text, &coordinates("q2,q1")).unwrap();
    let track = &all.recording.tracks[0];
    assert_eq!((track.len(), track.q[2 * 3], track.q[2 * 3 + 1], track.times[3]), (20, -3.0, 9.0, 0.3));
    assert_eq!((all.rows[0].row(3), all.time.as_deref(), track.validate(2)), (5, Some("t"), Ok(())));
    let dressed = format!("\u{feff}\r\n#t , q1,\"q2\"\r\n{}", &text[8..]).replace('\n', "\r\n\r\n");
    assert_eq!(read(&dressed, &coordinates("q2,q1")).unwrap().recording.tracks[0].q, track.q);
    // An old Mac's, of many lines or of one.
    let old = read(text.replace('\n', "\r"), &coordinates("q2,q1")).unwrap();
    assert_eq!((&old.recording.tracks[0].q, old.rows[0].row(3)), (&track.q, 5));
    assert_eq!(refusal("t,q1,q2\r", &coordinates("q2,q1")), "no rows of numbers");
    let bare = &text[8..];
    let numbered = Columns { time: Some("1".into()), ..coordinates("3,2") };
    assert_eq!(read(bare, &numbered).unwrap().recording.tracks[0].q, track.q);
    let named = Columns { names: Some(list("time,q1,q2")), ..coordinates("q2,q1") };
    assert_eq!(read(bare, &named).unwrap().recording.tracks[0].times, track.times);
    let rate = Columns { rate: Some(10.0), velocity: list("3"), ..coordinates("2") };
    let at_rate = read(bare, &rate).unwrap();
    assert_eq!((&at_rate.recording.tracks[0].times, at_rate.time), (&track.times, None));
    assert_eq!(at_rate.recording.tracks[0].v[4], -4.0);
}

#[test]
fn separators_and_comments_are_read() {
    let text = table("t,q1,q2", 20, &[]);
    let expected = read(&text, &coordinates("q2,q1")).unwrap().recording.tracks.remove(0);
    for separator in [";", "\t", "|", " ", "   "] {
        let track = read(text.replace(',', separator), &coordinates("q2,q1")).unwrap().recording.tracks.remove(0);
        assert_eq!((track.times, track.q), (expected.times.clone(), expected.q.clone()), "{separator:?}");
    }
    let remarks = format!("# measured by hand\n# {}", text.replacen("0.3,", "  # a pause\n0.3,", 1));
    let reading = read(&remarks, &coordinates("q2,q1")).unwrap();
    assert_eq!((reading.recording.tracks[0].q.clone(), reading.rows[0].row(3)), (expected.q.clone(), 7));
    // A title of a track above the header.
    for (title, separator) in [("mass A\n", "\t"), ("mass_A\n\n", ","), ("\u{feff}# x\nball\r\n", " ")] {
        let track = read(format!("{title}{}", text.replace(',', separator)), &coordinates("q2,q1")).unwrap();
        assert_eq!(track.recording.tracks[0].q, expected.q, "{title:?}");
    }
    // A comment that names nothing leaves numbers of columns.
    let numbered = Columns { time: Some("1".into()), ..coordinates("3,2") };
    let remarked = format!("# by hand\n{}", &text[8..]);
    assert_eq!(read(remarked, &numbered).unwrap().recording.tracks[0].q, expected.q);
}

#[test]
fn wrong_columns_are_named() {
    let text = table("t,theta1,theta2", 20, &[]);
    let says = |columns: Columns, expected: &str| assert_eq!(refusal(&text, &columns), expected);
    says(coordinates("thteta1"), "row 1: missing coordinate: unknown column \"thteta1\", did you mean \"theta1\"?");
    says(coordinates("4"), "row 1: missing coordinate: column 4, expected a number from 1 to 3");
    says(coordinates("theta1,2"), "row 1: missing column: column 2 is column theta1 again");
    let time = Columns { time: Some("tau".into()), ..coordinates("theta1") };
    says(time, "row 1: missing time: unknown column \"tau\", expected one of t, theta1, theta2");
    let named = Columns { names: Some(list("a,b,c")), ..coordinates("b") };
    assert!(refusal(&text, &named).contains("found the header t,theta1,theta2"));
    assert!(
        refusal(&text[16..], &Columns { names: Some(list("a,b")), ..coordinates("b") }).contains("expected 2 fields")
    );
    assert!(refusal(&text[16..], &Columns { rate: Some(1.0), ..coordinates("q") }).contains("in a file without names"));
    assert!(
        refusal(table("s,q1,q2", 20, &[]), &coordinates("q1"))
            .contains("no column is called t or time (there are s, q1, q2)")
    );
    assert_eq!(refusal(table("t,q1,q1", 20, &[]), &coordinates("q1")), "row 1: duplicate column q1");
}

#[test]
fn wrong_rows_are_named() {
    let with = |line: &str| refusal(table("t,q1,q2", 20, &[(4, line)]), &coordinates("q1,q2"));
    for bad in ["inf", "-infinity", "1e999", "x", "0x10", "1_000", "1;2"] {
        let expected = format!("row 6, column q1: expected a finite number, found {bad:?}");
        assert_eq!(with(&format!("0.4,{bad},4")), expected);
    }
    assert_eq!(with("0.4,1"), "row 6: expected 3 fields, found 2");
    assert_eq!(with("0.4"), "row 6: expected 3 fields, found 1");
    assert_eq!(with("0.4,1,2,"), "row 6: expected 3 fields, found 4");
    assert!(
        with("0.2,1,2").starts_with("row 6, column t: expected a time later than 0.3 of row 5, found 0.2 (another")
    );
    assert!(with("0.3,1,2").contains("later than 0.3 of row 5, found 0.3 with other values"));
    let blanks = table("t,q1,q2", 20, &[(4, "0.4,1")]).replace(',', " ");
    assert_eq!(refusal(blanks, &coordinates("q1")), "row 6: expected 3 fields separated by blanks, found 2");
    assert_eq!(refusal("", &coordinates("q1")), "the file is empty");
    assert_eq!(refusal("\u{feff}\n \n", &coordinates("q1")), "the file is empty");
    assert_eq!(refusal("t,q1\n", &coordinates("q1")), "no rows of numbers");
    let few = refusal(table("t,q1,q2", 15, &[]), &coordinates("q1"));
    assert_eq!(few, "expected at least 16 rows without a gap in time, found 15");
    assert_eq!(refusal(b"t,\0q1\n", &coordinates("q1")), "row 1: bytes that are not text");
    let bytes = [table("t,q1,q2", 3, &[]).as_bytes(), b"0.3,\xff,1\n0.4,\0,1\n"].concat();
    let expected = "row 5, column q1: expected a finite number, found \"ÿ\"; row 6: bytes that are not text";
    assert_eq!(refusal(bytes, &coordinates("q1")), expected);
    assert!(refusal(vec![b'1'; 2 << 20], &coordinates("1")).starts_with("row 1: a line of more than"));
}

#[test]
fn files_that_are_none() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |path: &Path| LoadedRecording::read(&[path], &coordinates("q")).unwrap_err().to_string();
    assert!(refused(folder.path()).ends_with("expected a regular file, found a directory"));
    assert!(refused(&folder.path().join("none.csv")).ends_with("none.csv: no such file"));
    let none: [&Path; 0] = [];
    assert!(matches!(LoadedRecording::read(&none, &coordinates("q")), Err(DataError::NoFiles)));
    let (_folder, path) = file("a.csv", table("t,q1,q2", 20, &[]).as_bytes());
    let twice = LoadedRecording::read(&[&path, &path], &coordinates("q1")).unwrap_err().to_string();
    assert!(twice.ends_with("a.csv: the file is given twice"), "{twice}");
}

#[test]
fn gaps_cut_and_repetitions_go() {
    // Steps of 0.1; rows 22 and 23 repeat; after 1.9 s comes 3.0 s; after 4.9 s three samples and 9 s.
    let mut text = "t,q\n".to_string();
    let times: Vec<f64> =
        (0..20).chain([19, 19]).chain(30..50).chain(60..63).chain(90..110).map(|k| f64::from(k) / 10.0).collect();
    for t in &times {
        writeln!(text, "{t},{}", t * t).unwrap();
    }
    let reading = read(&text, &coordinates("q")).unwrap();
    assert_eq!(reading.duplicates, 2);
    let names: Vec<&str> = reading.recording.tracks.iter().filter_map(|t| t.name.split("data ").nth(1)).collect();
    assert_eq!(names, ["rows 2-21", "rows 24-43", "rows 47-66"]);
    assert_eq!(reading.recording.tracks[1].times, times[22..42]);
    assert_eq!((reading.rows[1].row(0), reading.rows[2].row(19)), (24, 66));
    let rows: Vec<_> = reading.cuts.iter().map(|cut| (cut.before, cut.after, cut.steps.round())).collect();
    assert_eq!(rows, [(21, 24, 11.0), (43, 44, 11.0), (46, 47, 28.0)]);
    let dropped: Vec<_> = reading.dropped.iter().map(|d| (d.first, d.last, d.samples)).collect();
    assert_eq!(dropped, [(44, 46, 3)]);
}

#[test]
fn uneven_sampling_is_not_cut() {
    let mut text = "t,q\n".to_string();
    let mut t = 0.0;
    for k in 0..200 {
        writeln!(text, "{t},{k}").unwrap();
        // Steps from 0.02 to 0.18 s, then one of 2 s.
        t += if k == 99 { 2.0 } else { 0.1 + 0.08 * (1.7 * f64::from(k)).sin() };
    }
    let reading = read(&text, &coordinates("q")).unwrap();
    assert_eq!(
        reading.recording.tracks.iter().map(crate::recording::RecordedTrajectory::len).collect::<Vec<_>>(),
        [100, 100]
    );
}

#[test]
fn a_column_tells_trajectories_apart() {
    let mut text = "run,t,q\n".to_string();
    for k in 0..20 {
        writeln!(text, "a,{},{k}\n\"b 2\",{},{}", f64::from(k) / 10.0, f64::from(k) / 5.0, -k).unwrap();
    }
    let columns = Columns { trajectory: Some("run".into()), ..coordinates("q") };
    let reading = read(&text, &columns).unwrap();
    let tracks = &reading.recording.tracks;
    assert!(tracks[0].name.ends_with("data trajectory a") && tracks[1].name.ends_with("data trajectory b 2"));
    assert_eq!((tracks[1].q[7], tracks[1].times[5], reading.rows[1].row(7)), (-7.0, 1.0, 17));
}

#[test]
fn units_and_turns() {
    let mut text = "t,angle,x\n".to_string();
    for k in 0..100 {
        let angle = (f64::from(k) * 40.0 + 180.0).rem_euclid(360.0) - 180.0;
        writeln!(text, "{},{angle},{k}", 1e3 + 5.0 * f64::from(k)).unwrap();
    }
    let units = vec![("angle".into(), "deg".into()), ("t".into(), "ms".into()), ("x".into(), "0.01".into())];
    let columns = Columns { units, periodic: list("angle"), ..coordinates("angle,x") };
    let track = &read(&text, &columns).unwrap().recording.tracks[0];
    for k in 0..100 {
        let angle = (k as f64 * 40.0).to_radians();
        assert!((track.q[2 * k] - angle).abs() < 1e-12 && (track.q[2 * k + 1] - 0.01 * k as f64).abs() < 1e-15);
        assert!((track.times[k] - 1.0 - 0.005 * k as f64).abs() < 1e-12);
    }
    let huge = Columns { units: vec![("x".into(), "1e308".into())], ..coordinates("x") };
    assert!(refusal(&text, &huge).contains("row 4, column x"), "{}", refusal(&text, &huge));
}

/// An array file of version 1.
pub fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let header = format!("{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}\n");
    let length = u16::try_from(header.len()).unwrap().to_le_bytes();
    [b"\x93NUMPY\x01\x00", length.as_slice(), header.as_bytes(), data].concat()
}

pub fn bytes<const N: usize>(numbers: &[f64], of: impl Fn(f64) -> [u8; N]) -> Vec<u8> {
    numbers.iter().flat_map(|x| of(*x)).collect()
}

#[test]
fn arrays_of_all_kinds() {
    let rows: Vec<f64> = (0..20).flat_map(|k| [f64::from(k), f64::from(k * k), f64::from(-k)]).collect();
    let columns: Vec<f64> = (0..3).flat_map(|c| (0..20).map(move |r| 3 * r + c)).map(|k| rows[k]).collect();
    let numbered = Columns { time: Some("1".into()), ..coordinates("3,2") };
    let expected = [-3.0, 9.0];
    for (content, what) in [
        (npy("'<f8'", false, "(20, 3)", &bytes(&rows, f64::to_le_bytes)), "f8"),
        (npy("'>f8'", true, "(20, 3)", &bytes(&columns, f64::to_be_bytes)), "Fortran"),
        (npy("\"<f4\"", false, "(20, 3)", &bytes(&rows, |x| (x as f32).to_le_bytes())), "f4"),
        (npy("'>i2'", true, "(20,3)", &bytes(&columns, |x| (x as i16).to_be_bytes())), "i2"),
        (npy("'<i8'", false, "(20, 3)", &bytes(&rows, |x| (x as i64).to_le_bytes())), "i8"),
    ] {
        let reading = read(&content, &numbered).unwrap();
        assert_eq!(reading.recording.tracks[0].q[6..8], expected, "{what}");
        assert_eq!((reading.recording.tracks[0].times[3], reading.rows[0].row(3)), (3.0, 4), "{what}");
    }
    let named = Columns { names: Some(list("t,x,y")), ..coordinates("y,x") };
    let content = npy("'<f8'", false, "(20, 3)", &bytes(&rows, f64::to_le_bytes));
    assert_eq!(read(&content, &named).unwrap().recording.tracks[0].q[6..8], expected);
    let mut broken = rows.clone();
    broken[3 * 7 + 2] = f64::INFINITY;
    let content = npy("'<f8'", false, "(20, 3)", &bytes(&broken, f64::to_le_bytes));
    assert_eq!(refusal(content, &named), "row 8, column y: expected a finite number, found \"inf\"");
}

#[test]
fn arrays_that_are_refused() {
    let numbered = Columns { rate: Some(1.0), ..coordinates("1") };
    let data = bytes(&[1.0; 60], f64::to_le_bytes);
    let says = |descr: &str, shape: &str, part: &str| {
        let text = refusal(npy(descr, false, shape, &data), &numbered);
        assert!(text.contains(part), "{text}");
    };
    says("'<f8'", "(99999999999, 99999999999)", "the header states 99999999999 x 99999999999 numbers");
    says("'<f8'", "(61,)", "the header states 61 x 1 numbers (488 bytes), but 480 bytes follow it");
    says("'<f8'", "(59,)", "the header states 59 x 1 numbers (472 bytes), but 480 bytes follow it");
    says("'|O'", "(60,)", "Python objects");
    says("'<c16'", "(30,)", "complex numbers");
    says("'<U4'", "(30,)", "text");
    says("'|b1'", "(60,)", "truth values");
    says("'<f2'", "(60,)", "other elements");
    says("[('shape', '<f8')]", "(60,)", "records");
    says("'<f8'", "(3, 4, 5)", "3 dimensions");
    says("'<f8'", "(3, x)", "no readable shape");
    says("'<f8'", "(-3, 4)", "no readable shape");
    says("'é'", "(3, 4)", "other elements");
    assert!(refusal(npy("'<f8'", false, "(0,)", &[]), &numbered).contains("no rows"));
    assert!(refusal(b"\x93NUMPY\x01\x00\xff\xff{", &numbered).contains("header of the array"));
    assert!(refusal(b"\x93NUMPY\x09\x00\xff\xff{", &numbered).contains("version 9"));
    assert!(refusal(b"\x93NUMPY", &numbered).contains("cut off"));
}

pub fn npz(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (k, (name, content)) in arrays.iter().enumerate() {
        let method = [zip::CompressionMethod::Stored, zip::CompressionMethod::Deflated][k % 2];
        writer.start_file(*name, zip::write::SimpleFileOptions::default().compression_method(method)).unwrap();
        writer.write_all(content).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

#[test]
fn archives_of_arrays() {
    let vector = |count: usize, of: fn(f64) -> f64| {
        let numbers: Vec<f64> = (0..count).map(|k| of(k as f64)).collect();
        npy("'<f8'", false, &format!("({count},)"), &bytes(&numbers, f64::to_le_bytes))
    };
    let good = [("t.npy", vector(20, |k| k / 8.0)), ("x.npy", vector(20, |k| k * k)), ("y.npy", vector(21, |k| k))];
    let reading = read(npz(&good), &coordinates("x")).unwrap();
    assert_eq!((reading.recording.tracks[0].times[4], reading.recording.tracks[0].q[4]), (0.5, 16.0));
    assert_eq!(refusal(npz(&good), &coordinates("x,y")), "array y: 21 numbers, expected 20 as in array t");
    assert!(refusal(npz(&good), &coordinates("z")).contains("missing coordinate"));
    let table = npy("'<f8'", false, "(20, 2)", &bytes(&(0..40).map(f64::from).collect::<Vec<_>>(), f64::to_le_bytes));
    let numbered = Columns { rate: Some(2.0), ..coordinates("2") };
    assert_eq!(read(npz(&[("arr_0.npy", table.clone())]), &numbered).unwrap().recording.tracks[0].q[3], 7.0);
    assert!(
        refusal(npz(&[("t.npy", vector(20, |k| k)), ("q.npy", table)]), &coordinates("q")).contains("array q: 20 x 2")
    );
    let whole = npz(&good);
    for length in [4, 30, 100, whole.len() / 2, whole.len() - 1] {
        assert!(read(&whole[..length], &coordinates("x")).is_err(), "{length}");
    }
}

#[test]
fn archives_that_promise_too_much_are_refused_unread() {
    let zeros = |rows: usize| npy("'<f8'", false, &format!("({rows},)"), &vec![0; 8 * rows]);
    let deflated = |arrays: &[(&str, Vec<u8>)]| {
        let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for (name, content) in arrays {
            writer.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
            writer.write_all(content).unwrap();
        }
        writer.finish().unwrap().into_inner()
    };
    let rate = Columns { rate: Some(1.0), ..coordinates("q") };
    // 70 MB of zeros in 70 kB.
    let bomb = refusal(deflated(&[("q.npy", zeros(9_000_000)), ("r.npy", zeros(1))]), &rate);
    assert!(bomb.contains("more than 100 times as many"), "{bomb}");
    // Fewer are accepted, and so are unused ones.
    assert!(read(deflated(&[("q.npy", zeros(4_000)), ("r.npy", zeros(9_000_000))]), &rate).is_ok());
    // A table whose columns follow each other, packed.
    let columns: Vec<f64> = (0..60).map(|k| f64::from(k % 20) + f64::from(k / 20) * 100.0).collect();
    let table = npy("'<f8'", true, "(20, 3)", &bytes(&columns, f64::to_le_bytes));
    let numbered = Columns { time: Some("1".into()), ..coordinates("3,2") };
    let reading = read(deflated(&[("a.npy", table)]), &numbered).unwrap();
    assert_eq!(reading.recording.tracks[0].q[6..8], [203.0, 103.0]);
    // One flipped bit of the packed numbers.
    let mut broken = deflated(&[("q.npy", npy("'<f8'", false, "(100,)", &bytes(&[1.5; 100], f64::to_le_bytes)))]);
    let at = broken.len() / 3;
    broken[at] ^= 4;
    assert!(read(&broken, &Columns { rate: Some(1.0), ..coordinates("1") }).is_err());
}

#[test]
fn labels_are_bounded() {
    let mut text = "run,q\n".to_string();
    for k in 0..=100_000 {
        writeln!(text, "{k},1").unwrap();
    }
    let columns = Columns { trajectory: Some("run".into()), rate: Some(1.0), ..coordinates("q") };
    assert!(refusal(text, &columns).starts_with("row 100002, column run: more than 100000 different values"));
}

proptest! {
    #![proptest_config(crate::properties::properties(64))]

    #[test]
    fn numbers_survive(values in prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::ZERO, 40)) {
        let mut text = "t,x,y\n".to_string();
        for (k, pair) in values.chunks(2).enumerate() {
            writeln!(text, "{k},{:?},{:?}", pair[0], pair[1]).unwrap();
        }
        let reading = read(&text, &coordinates("x,y")).unwrap();
        prop_assert_eq!(&reading.recording.tracks[0].q, &values);
        prop_assert_eq!(reading.rows[0].clone(), { let mut rows = Rows::default(); rows.note(0, 2); rows });
    }

    #[test]
    fn arbitrary_bytes_do_not_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), at in 0usize..400) {
        let columns = Columns { rate: Some(1.0), ..coordinates("1") };
        let _ = read(&bytes, &columns);
        let _ = read([b"1,2\n".as_slice(), &bytes].concat(), &columns);
        let _ = read([b"\x93NUMPY\x01\x00".as_slice(), &bytes].concat(), &columns);
        let mut whole = npz(&[("a.npy", npy("'<f8'", false, "(2,)", &[1; 16])), ("b.npy", bytes.clone())]);
        let at = at % whole.len();
        whole[at] ^= bytes.first().copied().unwrap_or(1);
        let _ = read(&whole, &columns);
    }
}
