//! Tables of measured properties: the input of `tactus evaluate --properties`, and of the paper's own study.
//!
//! A CSV table with the columns `texture,movement,trial,set,traction,roughness,fineness` in any order. `texture` and
//! `movement` are names or numbers; `trial` is a number, once per texture, movement and set; `set` is `train` or
//! `validate`. Every texture has training trials of every movement, as many as there happen to be. Textures may do
//! without validation trials; one that has them has some of every movement.
use std::collections::{HashMap, HashSet};
use std::path::Path;

use crate::data::recordings::RecordingError;
use crate::data::rows::Rows;

const COLUMNS: [&str; 7] = [
    "texture",
    "movement",
    "trial",
    "set",
    "traction",
    "roughness",
    "fineness",
];

/// Traction in N, roughness and fineness as logarithms, of one trial.
pub type Properties = [f32; 3];

/// A table of properties.
#[derive(Clone, PartialEq, Debug)]
pub struct PropertyTable {
    /// Names of the textures, in the order in which they first come.
    pub textures: Vec<String>,
    /// Names of the movements, in the order in which they first come.
    pub movements: Vec<String>,
    /// Trials to learn from, by texture and movement, in the order of their numbers.
    pub train: Vec<Vec<Vec<Properties>>>,
    /// Trials to test on, by texture and movement; none for a texture that is only learned.
    pub validate: Vec<Vec<Vec<Properties>>>,
}

/// Trials with their numbers, by texture and movement.
type Trials = HashMap<(usize, usize), Vec<(u32, Properties)>>;

impl PropertyTable {
    /// Reads and checks a table.
    /// Errors: if it cannot be read, a row makes no sense, or trials are missing.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let mut rows = Rows::open(path, &COLUMNS, &[])?;
        let (mut textures, mut movements) = (Names::default(), Names::default());
        let (mut train, mut validate) = (Trials::new(), Trials::new());
        let mut seen = HashSet::new();
        while let Some(row) = rows.next_row()? {
            let index = |column, names: &mut Names| match row.shown(column)? {
                "" => Err(row.error(Some(column), "is empty; give a name or number")),
                name => Ok(names.position_or_push(name)),
            };
            let texture = index("texture", &mut textures)?;
            let movement = index("movement", &mut movements)?;
            let trial: u32 = row.parse("trial", "the number of a trial")?;
            let (set, trials) = match row.text("set") {
                "train" => ("train", &mut train),
                "validate" => ("validate", &mut validate),
                other => {
                    let cause = format!("{other:?} is neither train nor validate");
                    return Err(row.error(Some("set"), cause));
                }
            };
            if !seen.insert((texture, movement, trial, set == "train")) {
                let (texture, movement) = (&textures.list[texture], &movements.list[movement]);
                let cause = format!(
                    "{set} trial {trial} of texture {texture}, movement {movement} comes twice; number the trials"
                );
                return Err(row.error(Some("trial"), cause));
            }
            let properties = [
                row.number("traction")?,
                row.number("roughness")?,
                row.number("fineness")?,
            ];
            let key = (texture, movement);
            trials.entry(key).or_default().push((trial, properties));
        }
        let mut set = Self {
            textures: textures.list,
            movements: movements.list,
            train: Vec::new(),
            validate: Vec::new(),
        };
        set.check(path, &train, &validate)?;
        // from here on there is a row for every texture and movement: the lists are no longer than the table
        set.train = set.lists(train);
        set.validate = set.lists(validate);
        Ok(set)
    }

    fn check(&self, path: &Path, train: &Trials, validate: &Trials) -> Result<(), RecordingError> {
        for (set, trials) in [("train", train), ("validate", validate)] {
            if trials.is_empty() {
                let cause = format!("no {set} rows; the table needs both train and validate");
                return Err(RecordingError::at(path, cause));
            }
        }
        let movements = 0..self.movements.len();
        let keys = |texture| movements.clone().map(move |movement| (texture, movement));
        let count = |trials: &Trials, key| trials.get(&key).map_or(0, Vec::len);
        let name = |(texture, movement): (usize, usize)| {
            let (texture, movement) = (&self.textures[texture], &self.movements[movement]);
            format!("texture {texture}, movement {movement}")
        };
        // some trials, where the first pair was trained at all; tested, where the texture's first was
        let trained = train.keys().min().copied();
        for texture in 0..self.textures.len() {
            let tested = keys(texture).find(|key| count(validate, *key) > 0);
            for (set, trials, like) in [("train", train, trained), ("validate", validate, tested)] {
                let Some(like) = like else { continue };
                if let Some(at) = keys(texture).find(|key| count(trials, *key) == 0) {
                    let (at, there, like) = (name(at), count(trials, like), name(like));
                    let cause = format!(
                        "{at}: no {set} trials, where {like} has {there}; give some, or leave out the movement or the \
                         texture"
                    );
                    return Err(RecordingError::at(path, cause));
                }
            }
        }
        Ok(())
    }

    /// The trials of each texture and movement, in the order of their numbers.
    fn lists(&self, mut trials: Trials) -> Vec<Vec<Vec<Properties>>> {
        let mut list = |key| {
            let mut list = trials.remove(&key).unwrap_or_default();
            list.sort_by_key(|(number, _)| *number);
            list.into_iter().map(|(_, properties)| properties).collect()
        };
        let mut texture = |t| (0..self.movements.len()).map(|m| list((t, m))).collect();
        (0..self.textures.len()).map(&mut texture).collect()
    }
}

/// Names in the order in which they first come.
#[derive(Default)]
struct Names {
    list: Vec<String>,
    places: HashMap<String, usize>,
}

impl Names {
    fn position_or_push(&mut self, name: &str) -> usize {
        if let Some(place) = self.places.get(name) {
            return *place;
        }
        self.places.insert(name.to_owned(), self.list.len());
        self.list.push(name.to_owned());
        self.list.len() - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::cells;

    const HEADER: &str = "texture,movement,trial,set,traction,roughness,fineness";

    /// Textures silk and 7, movements fast and slow, two trials to train, one of silk to validate.
    fn rows() -> Vec<String> {
        let mut rows = vec![HEADER.to_owned()];
        for (t, texture) in ["silk", "7"].iter().enumerate() {
            for (m, movement) in ["fast", "slow"].iter().enumerate() {
                for trial in 1..=2 {
                    rows.push(format!(
                        "{texture},{movement},{trial},train,{t}.5,{m},{trial}e-1"
                    ));
                }
            }
        }
        rows.push("silk,slow,1,validate,8,8,8".to_owned());
        rows.push("silk,fast,1,validate,9,9,9".to_owned());
        rows
    }

    fn read(text: &str) -> Result<PropertyTable, RecordingError> {
        let file = tempfile::NamedTempFile::with_suffix("_world.csv").unwrap();
        std::fs::write(file.path(), text).unwrap();
        PropertyTable::read(file.path())
    }

    #[test]
    fn a_table_is_read_in_any_order_of_rows() {
        let set = read(&rows().join("\n")).unwrap();
        assert_eq!(set.textures, ["silk", "7"]);
        assert_eq!(set.movements, ["fast", "slow"]);
        assert_eq!(set.train[1][0], [[1.5, 0.0, 0.1], [1.5, 0.0, 0.2]]);
        assert_eq!(set.train[0][1], [[0.5, 1.0, 0.1], [0.5, 1.0, 0.2]]);
        assert_eq!(
            set.validate,
            [vec![vec![[9.0; 3]], vec![[8.0; 3]]], vec![vec![], vec![]]]
        );

        let mut turned = rows();
        turned[1..].reverse();
        let turned = read(&turned.join("\r\n")).unwrap();
        assert_eq!(turned, set);
    }

    #[test]
    fn numbers_of_trials_may_differ() {
        let mut rows = rows();
        rows.push("7,slow,3,train,4,4,4".to_owned());
        rows.push("silk,slow,2,validate,7,7,7".to_owned());
        let set = read(&rows.join("\n")).unwrap();
        let numbers = |set: &[Vec<Vec<Properties>>]| -> Vec<usize> {
            set.iter().flatten().map(Vec::len).collect()
        };
        assert_eq!(numbers(&set.train), [2, 2, 2, 3]);
        assert_eq!(numbers(&set.validate), [1, 2, 0, 0]);
    }

    #[test]
    fn errors_name_line_and_cause() {
        const CASES: &str = r#"
1 | fineness | finesse | :1:  | no column fineness
3 | 2e-1 | nan | :3: column fineness | not a finite number
3 | 0.5 | inf | :3: column traction | not a finite number
3 | 0.5 | | :3: column traction | "" is not a number
3 | ,0.5 | | :3:  | 6 fields where the header has 7
3 | train | test | :3: column set | "test" is neither train nor validate
3 | ,2, | ,two, | :3: column trial | "two" is not the number of a trial
3 | ,2, | ,1, | :3: column trial | train trial 1 of texture silk, movement fast comes twice
3 | silk | | :3: column texture | is empty
3 | fast | | :3: column movement | is empty
9 | 7 | 8 | texture 8, movement fast: no train trials | where texture silk, movement fast has 2
10 | silk | 7 | texture silk, movement slow: no validate trials | where texture silk, movement fast has 1
"#;
        for [line, from, to, place, cause] in cells(CASES) {
            let line: usize = line.parse().unwrap();
            let mut rows = rows();
            let changed = rows[line - 1].replacen(from, to, 1);
            assert_ne!(changed, rows[line - 1]);
            rows[line - 1] = changed;
            let message = read(&rows.join("\n")).unwrap_err().to_string();
            for part in ["_world.csv", place, cause] {
                assert!(message.contains(part), "{part:?} is not in {message:?}");
            }
        }
    }

    #[test]
    fn a_set_without_rows_is_refused() {
        for (kept, set) in [(0..9, "validate"), (9..11, "train"), (0..1, "train")] {
            let rows = rows();
            let mut lines = vec![HEADER];
            lines.extend(
                rows[kept]
                    .iter()
                    .map(String::as_str)
                    .filter(|r| *r != HEADER),
            );
            let message = read(&lines.join("\n")).unwrap_err().to_string();
            assert!(message.contains(&format!("no {set} rows")), "{message}");
        }
        let message = PropertyTable::read(Path::new("/nowhere/w.csv"))
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("/nowhere/w.csv:1: No such file"),
            "{message}"
        );
    }
}
