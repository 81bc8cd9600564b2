//! The examples of core and host tools: each is started once, and has less than 80 lines.

/// An example, and a test that starts it.
macro_rules! examples {
    ($($name:ident $path:literal;)*) => {$(
        #[path = $path]
        mod $name;
    )*
        #[test]
        fn each_is_short_and_in_the_list() {
            let listed = [$($path),*];
            let root = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/command"));
            let mut found = 0;
            for folder in ["../../shared/examples", "../../host-tools/cli/examples"] {
                for entry in std::fs::read_dir(root.join(folder)).unwrap() {
                    let path = entry.unwrap().path();
                    let name = path.file_name().unwrap().to_str().unwrap();
                    let file = format!("{folder}/{name}");
                    assert!(listed.contains(&file.as_str()), "{file} is not started");
                    let lines = std::fs::read_to_string(&path).unwrap().lines().count();
                    assert!(lines < 80, "{file} has {lines} lines");
                    found += 1;
                }
            }
            assert!(found >= 8);
        }

        mod started {
            $(
                #[test]
                fn $name() {
                    super::$name::main();
                }
            )*
        }
    };
}

examples! {
    decode_words "../../shared/examples/decode_words.rs";
    features_of_a_slide "../../shared/examples/features_of_a_slide.rs";
    learn_and_identify "../../shared/examples/learn_and_identify.rs";
    next_movement "../../shared/examples/next_movement.rs";
    novelty "../../shared/examples/novelty.rs";
    your_own_rig "../../shared/examples/your_own_rig.rs";
    read_recordings "../../host-tools/cli/examples/read_recordings.rs";
    talk_to_a_probe "../../host-tools/cli/examples/talk_to_a_probe.rs";
}
