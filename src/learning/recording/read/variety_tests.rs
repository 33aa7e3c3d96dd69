//! Files as people have them: with decimal commas, in other encodings, packed, with units, from other programs.

use super::tests::*;
use super::*;
use std::fmt::Write as _;
use std::io::Write as _;

/// Positions of the only trajectory and how the file was read.
fn taken(content: impl AsRef<[u8]>, columns: &Columns) -> (Vec<f64>, FileFacts) {
    let mut reading = read(content, columns).unwrap();
    assert_eq!((reading.recording.tracks.len(), reading.formats.len()), (1, 1));
    (reading.recording.tracks.remove(0).q, reading.formats.remove(0))
}

/// Rows of `t`, `x` with a quarter in both, in these writings of the separator and of the decimal mark.
fn rows(header: &str, separator: &str, mark: &str, quote: &str) -> String {
    (0..20).fold(header.to_string() + "\n", |text, k| {
        let field = |x: f64| format!("{quote}{}{quote}", format!("{x:?}").replace('.', mark));
        let (t, x) = (f64::from(k) / 4.0, 1.25 - f64::from(k));
        text + &field(t) + separator + &field(x) + "\n"
    })
}

fn expected() -> Vec<f64> {
    (0..20).map(|k| 1.25 - f64::from(k)).collect()
}

#[test]
fn decimal_commas_are_read() {
    for (separator, quote) in [(";", ""), ("\t", ""), (" ", ""), (" | ", ""), (",", "\""), (";", "\"")] {
        for header in [["t", "x"].join(separator), String::new()] {
            let numbered = Columns { time: Some("1".into()), ..coordinates("2") };
            let columns = if header.is_empty() { numbered } else { coordinates("x") };
            let (q, facts) = taken(rows(&header, separator, ",", quote), &columns);
            assert_eq!((q, facts.decimal_comma), (expected(), true), "{separator:?} {quote:?} {header:?}");
        }
    }
    let (q, facts) = taken(rows("t;x", ";", ".", ""), &coordinates("x"));
    assert_eq!((q, facts.decimal_comma, facts.separator), (expected(), false, Some(Separator::Semicolon)));
    // Exponents, whole numbers, and the line that states the separator to Excel.
    let text = rows("sep=;\nt;x", ";", ",", "").replace(";0,25", ";2,5e-1").replace(";-0,75", ";-75E-2");
    assert_eq!(taken(text.replace("4,0;", "4;"), &coordinates("x")).0, expected());
}

#[test]
fn decimal_marks_are_not_mixed() {
    let text = rows("t;x", ";", ",", "").replace("-1,75", "-1.75");
    let says = refusal(text, &coordinates("x"));
    assert_eq!(says, "row 5, column x: expected a decimal comma as in row 2, found \"-1.75\"");
    let text = rows("t;x", ";", ".", "").replace("-1.75", "-1,75");
    let says = refusal(text, &coordinates("x"));
    assert_eq!(says, "row 5, column x: expected a decimal point as in row 2, found \"-1,75\"");
    let says = refusal(rows("t;x", ";", ",", "").replace("-1,75", "-1.001,75"), &coordinates("x"));
    assert_eq!(says, "row 5, column x: expected a finite number, found \"-1.001,75\"");
}

#[test]
fn other_encodings_are_read() {
    let text = rows("Zeit [µs];Länge [mm]", ";", ",", "");
    let columns = Columns { time: Some("Zeit".into()), ..coordinates("Länge") };
    let latin: Vec<u8> = text.chars().map(|letter| u8::try_from(u32::from(letter)).unwrap()).collect();
    let wide = |of: fn(u16) -> [u8; 2]| ["\u{feff}", &text].concat().encode_utf16().flat_map(of).collect::<Vec<u8>>();
    for (bytes, encoding) in [
        (text.clone().into_bytes(), Encoding::Utf8),
        (latin, Encoding::Windows1252),
        (wide(u16::to_le_bytes), Encoding::Utf16),
        (wide(u16::to_be_bytes), Encoding::Utf16),
    ] {
        let (q, facts) = taken(&bytes, &columns);
        assert!(q.iter().zip(expected()).all(|(x, y)| (x - 1e-3 * y).abs() < 1e-15), "{encoding:?}");
        assert_eq!(facts.encoding, Some(encoding));
        assert_eq!((facts.units["Zeit"].as_str(), facts.units["Länge"].as_str()), ("µs", "mm"));
    }
    // Half a letter at the end, and a comment whose letters are from Windows.
    assert!(refusal(&wide(u16::to_le_bytes)[..301], &columns).contains("UTF-16"));
    let remarked = [b"# \x84gemessen\x93\n".as_slice(), rows("t,x", ",", ".", "").as_bytes()].concat();
    assert_eq!(taken(remarked, &coordinates("x")).0, expected());
    // Values that distinguish trajectories.
    let labelled = (0..16).fold(b"run,t,x\n".to_vec(), |text, k| {
        [text, format!("gr\u{fc}n,{k},{k}\n").chars().map(|c| c as u8).collect()].concat()
    });
    let reading = read(labelled, &Columns { trajectory: Some("run".into()), ..coordinates("x") }).unwrap();
    assert!(reading.recording.tracks[0].name.ends_with("trajectory grün"));
}

fn gzip(content: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(content).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn packed_text_is_read() {
    let text = rows("t,x", ",", ".", "");
    let (q, facts) = taken(gzip(text.as_bytes()), &coordinates("x"));
    assert_eq!((q, facts.gzip), (expected(), true));
    // Two members make one text, and an old Mac's lines are seen in it.
    let halves = [gzip(&text.as_bytes()[..50]), gzip(&text.as_bytes()[50..])].concat();
    assert_eq!(taken(halves, &coordinates("x")).0, expected());
    assert_eq!(taken(gzip(text.replace('\n', "\r").as_bytes()), &coordinates("x")).0, expected());
    let whole = gzip(text.as_bytes());
    for length in [2, 11, whole.len() / 2, whole.len() - 1] {
        assert!(refusal(&whole[..length], &coordinates("x")).contains("cut off"), "{length}");
    }
    for at in 0..whole.len() {
        let mut broken = whole.clone();
        broken[at] ^= 16;
        let _ = read(broken, &coordinates("x"));
    }
    let mut broken = whole.clone();
    broken[whole.len() - 6] ^= 1;
    assert!(refusal(broken, &coordinates("x")).contains("damaged"));
    let bomb = refusal(gzip(&[b"#".as_slice(), &[b'0'; 1022], b"\n"].concat().repeat(70 << 10)), &coordinates("x"));
    assert!(bomb.contains("more than 100 times"), "{bomb}");
    assert!(refusal(gzip(&whole), &coordinates("x")).contains("unpack"));
}

#[test]
fn units_of_headers_are_taken_and_names_are_plain() {
    let text = rows("t [ms],arm angle [deg]", ",", ".", "");
    for name in ["arm_angle", "arm angle [deg]", "arm angle"] {
        let columns = Columns { periodic: list("arm_angle"), ..coordinates(name) };
        let reading = read(&text, &columns).unwrap();
        let track = &reading.recording.tracks[0];
        assert_eq!(
            (reading.recording.coordinates.clone(), reading.columns.periodic.clone()),
            (list("arm_angle"), list("arm_angle"))
        );
        assert!((track.times[1] - 2.5e-4).abs() < 1e-18 && (track.q[1] - 0.25_f64.to_radians()).abs() < 1e-15);
        assert_eq!((reading.time.as_deref(), reading.coordinate_units()), (Some("t"), vec!["rad".to_string()]));
    }
    // Units of the description take precedence; the factor 1 means SI.
    let (units, given) = (list("arm_angle"), |unit: &str| vec![("arm_angle".to_string(), unit.to_string())]);
    let reading = read(&text, &Columns { units: given("1"), ..coordinates("arm_angle") }).unwrap();
    assert_eq!((reading.recording.tracks[0].q[1], reading.recording.coordinates.clone()), (0.25, units));
    assert!(!reading.formats[0].units.contains_key("arm_angle") && reading.formats[0].units["t"] == "ms");
    // An unknown unit matters only where it is used.
    let odd = rows("t,x [parsec]", ",", ".", "");
    assert!(refusal(&odd, &coordinates("x")).contains("column x: unknown unit \"parsec\""));
    let known = Columns { units: vec![("x".into(), "km".into())], ..coordinates("x") };
    assert_eq!(read(&odd, &known).unwrap().recording.tracks[0].q[0], 1250.0);
    assert!(read(rows("x,Time [fortnight]", ",", ".", ""), &Columns { rate: Some(1.0), ..coordinates("x") }).is_ok());
    assert!(refusal(rows("t,x [cm]", ",", ".", ""), &coordinates("x [mm]")).contains("missing coordinate"));
    // A unit given for a time column of another name is not silently ignored.
    let other = Columns { units: vec![("t".into(), "ms".into())], ..coordinates("x") };
    assert!(refusal(rows("time,x", ",", ".", ""), &other).contains("the time is the column time"));
    let time = Columns { units: vec![("Time".into(), "ms".into())], ..coordinates("x") };
    assert_eq!(read(rows("Time,x", ",", ".", ""), &time).unwrap().recording.tracks[0].times[4], 1e-3);
}

#[test]
fn columns_that_share_a_name_keep_their_headers() {
    let mut text = "t,x [m],x [mm]\n".to_string();
    (0..16).for_each(|k| writeln!(text, "{k},{k},{}", 2000 * k).unwrap());
    let reading = read(&text, &coordinates("x [mm],x [m]")).unwrap();
    assert_eq!(reading.recording.coordinates, ["x [mm]", "x [m]"]);
    assert_eq!(reading.recording.tracks[0].q[2..4], [2.0, 1.0]);
    assert!(refusal(&text, &coordinates("x")).contains("missing coordinate"));
    // An error is in the unit of its coordinate unless its own header says otherwise.
    let mut text = "t,x [mm],sx,sy [m]\n".to_string();
    (0..16).for_each(|k| writeln!(text, "{k},{k},2,2").unwrap());
    for (error, size) in [("sx", 2e-3), ("sy", 2.0)] {
        let reading = read(&text, &Columns { error: list(error), ..coordinates("x") }).unwrap();
        assert_eq!(reading.errors[0][0], size);
    }
}

#[test]
fn missing_readings_leave_out_rows_or_are_marked() {
    let gaps: Vec<(usize, &str)> = vec![(2, "0.2,,7"), (3, "0.3,nan,"), (6, "0.6,NA,5"), (9, ",1,1")];
    let file = table("t,q1,q2", 40, &gaps);
    let full = read(table("t,q1,q2", 40, &[]), &coordinates("q1,q2")).unwrap();
    // A row that lacks something counts as missing.
    let reading = read(&file, &coordinates("q1,q2")).unwrap();
    assert_eq!((reading.incomplete, reading.recording.samples(), reading.missing.len()), (4, 36, 0));
    assert_eq!(reading.bridged.rows, 4);
    // Columns that were not requested may lack anything.
    assert_eq!(read(&file, &coordinates("q2")).unwrap().incomplete, 2);
    // Who follows whole trajectories takes the other readings of such rows.
    let whole = Columns { whole: true, ..coordinates("q1,q2") };
    let reading = read(&file, &whole).unwrap();
    let track = &reading.recording.tracks[0];
    assert_eq!((reading.incomplete, track.len(), track.q[2 * 2 + 1]), (2, 38, 7.0));
    let marked: Vec<usize> = (0..76).filter(|k| reading.missing[0][*k]).collect();
    assert_eq!(marked, [4, 10]);
    let (a, b) = (full.recording.tracks[0].q[2], full.recording.tracks[0].q[8]);
    assert!((track.q[4] - (a + (b - a) / 3.0)).abs() < 1e-12, "{:?}", &track.q[..12]);
    // An angle continues from its last reading.
    let turns =
        |k: usize| if k % 3 == 1 { String::new() } else { (k as f64 * 1.3 % std::f64::consts::TAU).to_string() };
    let rows: String = (0..30).map(|k| format!("{k},{},{k}\n", turns(k))).collect();
    let angle = Columns { periodic: list("a"), whole: true, ..coordinates("a,b") };
    let reading = read(format!("t,a,b\n{rows}"), &angle).unwrap();
    let q = &reading.recording.tracks[0].q;
    assert!((0..30).all(|k| (q[2 * k] - 1.3 * k as f64).abs() < 1e-5), "{q:?}");
    // Most rows lack something, or all of a column does.
    let rows: String = (0..30).map(|k| format!("{k},{},1\n", if k % 3 == 0 { "2" } else { "" })).collect();
    assert!(
        refusal(format!("t,q1,q2\n{rows}"), &coordinates("q1,q2")).contains("row 3, column q1: no reading; 20 rows")
    );
    let rows: String = (0..30).map(|k| format!("{k},,{k}\n")).collect();
    assert!(refusal(format!("t,q1,q2\n{rows}"), &whole).contains("column q1: no reading"));
    let mut numbers: Vec<f64> = (0..60).map(f64::from).collect();
    numbers[4] = f64::NAN;
    let array = npy("'<f8'", false, "(20, 3)", &bytes(&numbers, f64::to_le_bytes));
    assert_eq!(read(array, &Columns { time: Some("1".into()), ..coordinates("2,3") }).unwrap().incomplete, 1);
}

#[test]
fn several_mistakes_are_told_at_once() {
    let bad: Vec<(usize, &str)> =
        vec![(2, "0.2,x,y"), (3, "0.3,1"), (5, "?,5,6"), (7, "0.7,inf,0"), (8, "0.8,!,!"), (9, "0.9,--,1")];
    let says = refusal(table("t,q1,q2", 20, &bad), &coordinates("q1,q2"));
    for part in
        ["row 4, column q1", "row 4, column q2", "row 5: expected 3 fields", "row 7, column t", "row 9, column q1"]
    {
        assert!(says.contains(part), "{says}");
    }
    assert!(says.ends_with("; and 3 more"), "{says}");
    let says =
        refusal(table("t,q1,q2", 20, &[]), &Columns { velocity: list("v1"), force: list("u"), ..coordinates("p") });
    assert!(
        ["missing coordinate", "missing velocity", "missing force"].iter().all(|part| says.contains(part)),
        "{says}"
    );
    let mut numbers: Vec<f64> = (0..60).map(f64::from).collect();
    (numbers[4], numbers[17]) = (f64::NEG_INFINITY, f64::INFINITY);
    let array = npy("'<f8'", false, "(20, 3)", &bytes(&numbers, f64::to_le_bytes));
    let says = refusal(array, &Columns { time: Some("1".into()), ..coordinates("2,3") });
    assert!(says.contains("row 2, column 2") && says.contains("row 6, column 3"), "{says}");
}

/// Three runs side by side, of 20, 18 and 20 rows, the last from the third row on.
fn side_by_side(header: &str, separator: &str) -> String {
    (0..20).fold(header.replace(',', separator) + "\n", |text, k| {
        let pair = |number: i32, there: bool| if there { format!("{},{}", number * k, k * k) } else { ",".to_string() };
        let row = format!("{k},{},{},{}", pair(1, true), pair(2, k < 18), pair(3, k > 2));
        text + &row.replace(',', separator) + "\n"
    })
}

#[test]
fn trajectories_side_by_side_are_read() {
    let header = "t,s1 [cm],theta1,s2 [m],theta2,s3 [cm],theta3";
    for separator in [",", ";", "\t"] {
        let columns = Columns { wide: true, ..coordinates("s,theta") };
        let reading = read(side_by_side(header, separator), &columns).unwrap();
        let tracks = &reading.recording.tracks;
        assert_eq!(tracks.iter().map(|track| track.len()).collect::<Vec<_>>(), [20, 18, 17], "{separator:?}");
        assert!(tracks[1].name.ends_with("trajectory 2") && reading.recording.coordinates == ["s", "theta"]);
        assert_eq!((tracks[0].q[2], tracks[1].q[2], tracks[2].times[0]), (0.01, 2.0, 3.0));
        assert_eq!((reading.rows[2].row(0), reading.takes.clone()), (5, vec![0, 1, 2]));
    }
    let text = side_by_side(header, ",");
    let says = |columns: Columns| refusal(&text, &Columns { wide: true, ..columns });
    assert!(says(coordinates("s,phi")).contains("phi1") && says(coordinates("x")).contains("side by side"));
    let partial = text.replace("theta2", "other");
    assert!(refusal(partial, &Columns { wide: true, ..coordinates("s,theta") }).contains("theta2"));
    // Half of a run's coordinates.
    let half = text.replace("\n19,19,361,,", "\n19,19,361,5,");
    assert!(refusal(half, &Columns { wide: true, ..coordinates("s,theta") }).contains("row 21, column theta2"));
    // Runs of a rate may end early and begin late, but have no gap.
    let rate = Columns { wide: true, rate: Some(2.0), ..coordinates("s,theta") };
    assert_eq!(read(&text, &rate).unwrap().recording.tracks[2].times[1], 0.5);
    let gap = text.replace("\n9,9,81,18,81,", "\n9,9,81,,,");
    assert!(refusal(&gap, &rate).contains("row 11, column s2"));
    let reading = read(&gap, &Columns { wide: true, ..coordinates("s,theta") }).unwrap();
    assert_eq!((reading.bridged.gaps, reading.recording.tracks[1].len()), (1, 17));
    // Clocks of their own.
    let mut text = "t1,x1,t2,x2\n".to_string();
    (0..16).for_each(|k| writeln!(text, "{k},{k},{},{k}", 2 * k).unwrap());
    let reading = read(&text, &Columns { wide: true, ..coordinates("x") }).unwrap();
    assert_eq!(reading.recording.tracks.iter().map(|track| track.times[3]).collect::<Vec<_>>(), [3.0, 6.0]);
    let named = Columns { wide: true, time: Some("t".into()), ..coordinates("x") };
    assert_eq!(read(&text, &named).unwrap().recording.tracks[1].times, reading.recording.tracks[1].times);
}

#[test]
fn arrays_side_by_side_may_differ_in_length() {
    let vector = |count: usize| {
        let numbers: Vec<f64> = (0..count).map(|k| k as f64).collect();
        npy("'<f8'", false, &format!("({count},)"), &bytes(&numbers, f64::to_le_bytes))
    };
    let arrays = [("t1.npy", vector(20)), ("x1.npy", vector(20)), ("t2.npy", vector(30)), ("x2.npy", vector(30))];
    let reading = read(npz(&arrays), &Columns { wide: true, ..coordinates("x") }).unwrap();
    assert_eq!(reading.recording.tracks.iter().map(|track| track.len()).collect::<Vec<_>>(), [20, 30]);
    for fortran in [false, true] {
        let table =
            npy("'<f8'", fortran, "(20, 3)", &bytes(&(0..60).map(f64::from).collect::<Vec<_>>(), f64::to_le_bytes));
        let columns = Columns { wide: true, names: Some(list("t,x1,x2")), ..coordinates("x") };
        for content in [table.clone(), npz(&[("a.npy", table.clone())])] {
            assert_eq!(read(content, &columns).unwrap().recording.tracks.len(), 2);
        }
    }
}

/// A workbook whose first sheet has these rows.
fn workbook(rows: &str, texts: &str) -> Vec<u8> {
    let entries = [
        (
            "xl/workbook.xml",
            "<workbook><sheets><sheet name=\"b\" sheetId=\"2\" r:id=\"rId7\"/><sheet name=\"a\" r:id=\"rId1\"/></sheets></workbook>",
        ),
        (
            "xl/_rels/workbook.xml.rels",
            "<Relationships><Relationship Id=\"rId1\" Target=\"worksheets/sheet1.xml\"/>\
             <Relationship Id=\"rId7\" Target=\"/xl/worksheets/sheet2.xml\"/></Relationships>",
        ),
        ("xl/sharedStrings.xml", texts),
        ("xl/worksheets/sheet1.xml", "<worksheet/>"),
        ("xl/worksheets/sheet2.xml", &format!("<worksheet><sheetData>{rows}</sheetData></worksheet>")),
    ];
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, content) in entries {
        writer.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        writer.write_all(content.as_bytes()).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

#[test]
fn workbooks_are_read() {
    let texts = "<sst><si><t>t [ms]</t></si><si><r><t>arm </t></r><r><t xml:space=\"preserve\">angle &lt;1&gt;</t></r><rPh><t>no</t></rPh></si></sst>";
    let mut rows = "<row r=\"2\"><c r=\"B2\" t=\"s\"><v>0</v></c><c r=\"C2\" t=\"s\"><v>1</v></c>\
                    <c r=\"D2\" t=\"inlineStr\"><is><t>note</t></is></c></row>"
        .to_string();
    for k in 0..16 {
        let (r, note) = (k + 4, if k == 3 { "<c r=\"D7\" t=\"e\"><v>#N/A</v></c>" } else { "" });
        write!(
            rows,
            "<row r=\"{r}\"><c r=\"B{r}\" s=\"1\"><v>{k}</v></c><c r=\"C{r}\"><f>A1*2</f><v>{}E-1</v></c>{note}</row>",
            5 * k
        )
        .unwrap();
    }
    let book = workbook(&rows, texts);
    let reading = read(&book, &coordinates("arm_angle_<1>")).unwrap();
    let track = &reading.recording.tracks[0];
    assert_eq!((track.q[3], track.times[3], reading.rows[0].row(3)), (1.5, 3e-3, 7));
    assert_eq!(reading.formats[0].kind, FileKind::Xlsx);
    let says = refusal(workbook(&rows, texts), &coordinates("note"));
    assert!(says.contains("row 7, column note"), "{says}");
    for broken in [
        rows.replace("<v>1</v></c><c r=\"D2", "<v>9</v></c><c r=\"D2"),
        rows.replace("r=\"4\"", "r=\"1\""),
        rows.replace("C5", "A5"),
    ] {
        assert!(refusal(workbook(&broken, texts), &coordinates("note")).contains("damaged workbook"));
    }
    for length in [30, 100, book.len() / 2, book.len() - 1] {
        assert!(read(&book[..length], &coordinates("note")).is_err(), "{length}");
    }
}

#[test]
fn files_of_other_programs_are_named() {
    let zipped = |name: &str| npz(&[(name, b"x".to_vec())]);
    for (content, part) in [
        (b"MATLAB 5.0 MAT-file, Platform: GLNXA64".to_vec(), "writetable"),
        ([b"MATLAB 7.3 MAT-file".as_slice(), &[0; 600]].concat(), "h5py"),
        (b"\x89HDF\r\n\x1a\n\0\0".to_vec(), "HDF5"),
        ([vec![0; 512], b"\x89HDF\r\n\x1a\n".to_vec()].concat(), "HDF5"),
        (b"PAR1\x15\x04".to_vec(), "read_parquet"),
        (b"ARROW1\0\0".to_vec(), "read_feather"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1".to_vec(), "Save As"),
        (zipped("content.xml"), "OpenDocument"),
        (zipped("data/motion.csv"), "unpack"),
        (gzip(b"PAR1\x15\x04"), "read_parquet"),
    ] {
        let says = refusal(content, &coordinates("x"));
        assert!(says.contains(part) && says.lines().count() == 1, "{says}");
    }
}
