//! Shard: the part of a list of recordings to work on, given explicitly or by the array job that runs this task.

use std::env;

use stillpoint::Error;

/// Part `index` of `count`, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: usize,
    count: usize,
}

/// Environment variables of array jobs: index of the task, number of tasks, the first index, and the step from one index to
/// the next.
const ARRAYS: [(&str, &str, Option<[&str; 2]>); 3] = [
    ("JOB_COMPLETION_INDEX", "JOB_COMPLETION_COUNT", None),
    ("AWS_BATCH_JOB_ARRAY_INDEX", "AWS_BATCH_JOB_ARRAY_SIZE", None),
    ("SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT", Some(["SLURM_ARRAY_TASK_MIN", "SLURM_ARRAY_TASK_STEP"])),
];

impl Shard {
    /// Chooses the shard; the whole list where nothing is given.
    pub fn choose(typed: Option<&str>, is_list: bool) -> Result<Self, Error> {
        let shard = Self::of(typed, is_list, |name| env::var(name).ok())?;
        if shard.count > 1 {
            tracing::info!("part {} of {} of the recordings, counted from 0", shard.index, shard.count);
        }
        Ok(shard)
    }

    /// Whether the recording at this place of the list belongs to the shard.
    pub fn holds(self, place: usize) -> bool {
        place % self.count == self.index
    }

    fn of(typed: Option<&str>, is_list: bool, variable: impl Fn(&str) -> Option<String>) -> Result<Self, Error> {
        let number = |text: &str| text.trim().parse::<usize>().ok();
        let wrong = |why: String| Err(Error::Usage(why));
        let (index, count) = match typed {
            Some(text) if text != "auto" && !text.starts_with("auto/") => {
                let parts = text.split_once('/').and_then(|(index, count)| Some((number(index)?, number(count)?)));
                let Some(parts) = parts else {
                    return wrong(format!("--shard {text}: expected I/N, such as 0/10, or auto"));
                };
                parts
            }
            None if !is_list => return Ok(Self { index: 0, count: 1 }),
            auto => {
                let said = auto.and_then(|auto| auto.strip_prefix("auto/"));
                let array = ARRAYS.into_iter().find_map(|array| Some((array, variable(array.0)?)));
                let Some(((name, count_name, steps), index)) = array else {
                    return match auto {
                        None => Ok(Self { index: 0, count: 1 }),
                        Some(_) => {
                            wrong(format!("--shard auto: none of {} is set", ARRAYS.map(|array| array.0).join(", ")))
                        }
                    };
                };
                let count = said.map(str::to_owned).or_else(|| variable(count_name));
                let Some(count) = count else {
                    return match auto {
                        None => Ok(Self { index: 0, count: 1 }),
                        Some(_) => {
                            wrong(format!("--shard auto: {name} says which part, and nothing of how many: use auto/N"))
                        }
                    };
                };
                let [first, step] = steps.map_or([None, None], |names| names.map(&variable));
                let first = first.map_or(Some(0), |first| number(&first));
                let step = step.map_or(Some(1), |step| number(&step));
                let index = number(&index).zip(first).and_then(|(index, first)| index.checked_sub(first));
                let place = index.zip(step).filter(|(index, step)| index.checked_rem(*step) == Some(0));
                let Some(parts) = place.map(|(index, step)| index / step).zip(number(&count)) else {
                    return wrong(format!("{name} and the number of parts ({count}) are no two numbers"));
                };
                parts
            }
        };
        match index < count {
            true => Ok(Self { index, count }),
            false => wrong(format!(
                "part {index} of {count}: parts are counted from 0, so the last one is {}",
                count.saturating_sub(1)
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(typed: Option<&str>, is_list: bool, set: &[(&str, &str)]) -> Option<(usize, usize)> {
        let variable = |name: &str| set.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned());
        Shard::of(typed, is_list, variable).ok().map(|shard| (shard.index, shard.count))
    }

    #[test]
    fn a_part_is_said_by_hand_or_by_the_array_job() {
        let slurm = [("SLURM_ARRAY_TASK_ID", "5"), ("SLURM_ARRAY_TASK_COUNT", "4"), ("SLURM_ARRAY_TASK_MIN", "2")];
        let kubernetes = [("JOB_COMPLETION_INDEX", "3")];
        let aws = [("AWS_BATCH_JOB_ARRAY_INDEX", "1"), ("AWS_BATCH_JOB_ARRAY_SIZE", "9")];
        assert_eq!(of(Some("2/7"), true, &slurm), Some((2, 7)), "what is typed wins");
        assert_eq!(of(None, true, &slurm), Some((3, 4)));
        let in_steps = [
            ("SLURM_ARRAY_TASK_ID", "3"),
            ("SLURM_ARRAY_TASK_COUNT", "2"),
            ("SLURM_ARRAY_TASK_MIN", "1"),
            ("SLURM_ARRAY_TASK_STEP", "2"),
        ];
        assert_eq!(of(None, true, &in_steps), Some((1, 2)));
        assert_eq!(of(None, false, &slurm), Some((0, 1)), "files that are named are all meant");
        assert_eq!(of(Some("auto"), false, &aws), Some((1, 9)));
        assert_eq!(of(Some("auto/5"), true, &kubernetes), Some((3, 5)));
        assert_eq!(of(None, true, &kubernetes), Some((0, 1)), "of how many is not known");
        for (typed, set) in
            [("auto", &kubernetes[..]), ("auto", &[]), ("7/7", &[]), ("1", &[]), ("0/0", &[]), ("-1/2", &[])]
        {
            assert_eq!(of(Some(typed), true, set), None, "{typed}");
        }
    }

    #[test]
    fn every_recording_belongs_to_one_part() {
        let parts = (0..3).map(|index| Shard { index, count: 3 });
        let parts: Vec<_> = parts.collect();
        assert!((0..20).all(|place| parts.iter().filter(|part| part.holds(place)).count() == 1));
    }
}
