//! Writing recordings, and going on where a writer was cut off.

use super::*;

#[test]
fn the_writer_refuses_what_the_reader_would() {
    let folder = TempDir::new().unwrap();
    let textures = vec![texture(1, "felt"), texture(2, "silk")];
    let writer = RecordingWriter::begin(folder.path(), textures.clone(), "test").unwrap();
    let mut writer = writer.by_hand();
    writer.write(&slide(0, 1)).unwrap();
    let message = |e: RecordingError| e.to_string();
    let twice = message(writer.write(&slide(0, 1)).unwrap_err());
    assert!(
        twice.contains("slide 1 of texture 1 is listed twice"),
        "{twice}"
    );
    let mut short = slide(0, 2);
    short.blocks.truncate(1);
    let short = message(writer.write(&short).unwrap_err());
    assert!(short.contains("P_AC (samples: 64"), "{short}");
    // a writer that ends here leaves no recordings
    let empty = message(writer.finish().unwrap_err());
    assert!(empty.contains("texture 2 (silk) has no slide"), "{empty}");
    fails(folder.path(), &["recordings that are not whole, by: test"]);
    let other = RecordingWriter::begin(folder.path(), textures.clone(), "another");
    let other = message(other.unwrap_err());
    assert!(other.contains("not whole, by: test"), "{other}");

    // and the same one continues, once
    let mut writer = RecordingWriter::begin(folder.path(), textures.clone(), "test").unwrap();
    assert!(writer.has(0, 1) && !writer.has(1, 1));
    writer.write(&slide(1, 1)).unwrap();
    writer.finish().unwrap();
    let taken = message(RecordingWriter::begin(folder.path(), textures, "test").unwrap_err());
    assert!(
        taken.contains("already holds recordings (manifest.csv)"),
        "{taken}"
    );
    let twins = vec![texture(1, "felt"), texture(1, "silk")];
    let twins =
        message(RecordingWriter::begin(&folder.path().join("new"), twins, "test").unwrap_err());
    assert!(twins.contains("texture 1"), "{twins}");
}

/// The files of a folder, by name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    entries
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, fs::read(entry.path()).unwrap())
        })
        .collect()
}

#[test]
fn a_writer_goes_on_wherever_the_last_one_was_cut_off() {
    let textures = vec![texture(7, "cotton, \"washed\""), texture(3, "felt")];
    let slides = [slide(0, 1), slide(0, 4), slide(1, 2)];
    let begin = |folder: &Path| {
        let begun = RecordingWriter::begin(folder, textures.clone(), "test");
        begun.unwrap().by_hand()
    };
    let whole = TempDir::new().unwrap();
    let mut writer = begin(whole.path());
    for slide in &slides {
        writer.write(slide).unwrap();
    }
    let rows = fs::read(whole.path().join("manifest.csv.part")).unwrap();
    writer.finish().unwrap();
    let whole = files(whole.path());
    let mut gone_on = [0; 4];
    for cut in (0..=rows.len()).step_by(29) {
        let folder = TempDir::new().unwrap();
        let mut writer = begin(folder.path());
        slides.iter().for_each(|slide| writer.write(slide).unwrap());
        drop(writer);
        fs::write(folder.path().join("manifest.csv.part"), &rows[..cut]).unwrap();
        // of a full disk
        if cut % 2 == 0 {
            fs::write(folder.path().join("t007_s004_pac.npy"), b"").unwrap();
        }
        assert!(RecordingSet::open(folder.path()).is_err());
        let mut writer = begin(folder.path());
        let todo = slides.iter().filter(|s| !writer.has(s.texture, s.number));
        let todo: Vec<&Recording> = todo.collect();
        gone_on[slides.len() - todo.len()] += 1;
        todo.iter().for_each(|slide| writer.write(slide).unwrap());
        writer.finish().unwrap();
        assert_eq!(files(folder.path()), whole, "{cut}");
    }
    assert!(gone_on[..3].iter().all(|n| *n > 0), "{gone_on:?}");
}

#[test]
fn nothing_is_written_among_other_files() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("mine"), b"").unwrap();
    let begun = RecordingWriter::begin(folder.path(), vec![texture(1, "felt")], "test");
    let said = begun.unwrap_err().to_string();
    assert!(said.contains("is not empty"), "{said}");
    assert_eq!(files(folder.path()).len(), 1);
}

#[test]
fn npyz_reads_what_is_written_and_writes_what_is_read() {
    let samples = [0, 1, -1, i16::MAX, i16::MIN];
    let bytes = npy::write(&samples);
    let file = npyz::NpyFile::new(bytes.as_slice()).unwrap();
    assert_eq!(file.shape(), [5]);
    assert_eq!(file.into_vec::<i16>().unwrap(), samples);
    // as numpy.save writes it, but in the format's version 2
    let text = "{'descr': '<i2', 'fortran_order': False, 'shape': (1,), }         \n";
    let bytes = [
        b"\x93NUMPY\x02\0",
        &(text.len() as u32).to_le_bytes()[..],
        text.as_bytes(),
        b"\x02\x01",
    ]
    .concat();
    assert_eq!(npy::read(&bytes), Ok(vec![0x102]));
}
