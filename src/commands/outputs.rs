//! Recordings that `stillpoint annotate` is to work on, and the path of each one's result.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::path::{Component, Path, PathBuf};

use stillpoint::Error;
use stillpoint::run::{self, Made};
use tracing::info;

use super::listing::Named;
use crate::cli;

/// Path of a result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    pub path: PathBuf,
    /// Reason why nothing may be written there.
    pub refusal: Option<String>,
}

/// The recordings among the inputs, each once, without results of an earlier run on one of them, as when all files of a
/// folder are named a second time.
pub fn recordings(args: &cli::Annotate, named: Vec<Named>) -> Result<Vec<Named>, Error> {
    let named = once(args, named)?;
    if named.len() < 2 {
        return Ok(named);
    }
    let folder = args.out_dir.as_deref();
    let flat = |named: &Named, folder: Option<PathBuf>| {
        run::default_output(&named.path, named.path.is_dir(), folder.as_deref(), false)
    };
    let results: BTreeSet<_> = named
        .iter()
        .flat_map(|named| {
            let within = folder.map(|folder| run::under(folder, &named.below));
            let both = [flat(named, None), flat(named, within)];
            both.into_iter().filter(|output| *output != named.path)
        })
        .collect();
    // Below the folder of results, those that were told apart by their folders keep their names.
    let below = Below::of(folder);
    let elsewhere = named.iter().filter(|named| !below.holds(&named.path));
    let names: BTreeSet<_> = elsewhere.filter_map(|named| Some(flat(named, None).file_name()?.to_owned())).collect();
    let is_named_so = |path: &Path| path.file_name().is_some_and(|name| names.contains(name));
    let is_result = |named: &Named| {
        let path = &named.path;
        match (!run::is_url(path)).then(|| run::made(path)).flatten() {
            // To look into each object would be a request.
            _ if run::is_url(path) => run::is_sidecar_name(path) || results.contains(path),
            Some(Made::Sidecar) => true,
            Some(Made::Annotated) => results.contains(path) || is_named_so(path) && below.holds(path),
            None => false,
        }
    };
    let (made, recordings): (Vec<_>, Vec<_>) = named.iter().partition(|named| is_result(named));
    if recordings.is_empty() {
        return Ok(named);
    }
    if let Some(first) = made.first() {
        let more = if made.len() > 1 { format!(" and {} more", made.len() - 1) } else { String::new() };
        info!("left out, as results of Stillpoint: {}{more}", first.path.display());
    }
    Ok(recordings.into_iter().cloned().collect())
}

/// The inputs without those that were named before. By hand nobody means a recording twice; a list may name it again.
fn once(args: &cli::Annotate, named: Vec<Named>) -> Result<Vec<Named>, Error> {
    let mut seen = BTreeMap::<PathBuf, Named>::new();
    let mut kept = Vec::new();
    for named in named {
        let place = whole(&named.path, args.join);
        let Some(other) = seen.get(&place) else {
            kept.push(named.clone());
            seen.insert(place, named);
            continue;
        };
        let (first, again) = (other.path.display(), named.path.display());
        let spelled = if other.path == named.path { String::new() } else { format!(" (and as {again})") };
        if other.is_typed && named.is_typed && !args.in_place {
            return Err(Error::Usage(format!("{first}: is named twice{spelled}; name each recording once")));
        }
        info!("{first}: is named twice{spelled}, and counts once");
    }
    Ok(kept)
}

/// Paths of the results, one for each input. In a `--out-dir`, recordings keep the folders below the prefix that stands for
/// them; others only those that tell apart what would have one name. What nothing tells apart is refused: of a list alone,
/// of other inputs with all of them.
pub fn outputs(args: &cli::Annotate, inputs: &[Named], is_list: bool) -> Result<Vec<Output>, Error> {
    let free = |path: PathBuf| Output { path, refusal: None };
    if args.in_place {
        return match inputs.iter().find(|input| run::is_url(&input.path)) {
            None => Ok(inputs.iter().map(|input| free(input.path.clone())).collect()),
            Some(object) => {
                let why = "an object cannot be changed in place; without --in-place a sidecar is put beside it";
                Err(Error::Usage(format!("{}: {why}", object.path.display())))
            }
        };
    }
    if let Some(output) = &args.output {
        return match inputs {
            [_] => Ok(vec![free(output.clone())]),
            _ if args.join && args.sidecar => Ok(vec![free(output.clone())]),
            _ if args.join => {
                let output = output.display();
                Err(Error::Usage(format!(
                    "-o {output}: each of the joined files keeps a file of its own; --out-dir {output} names a folder for \
                     them, or --sidecar -o {output} one file for all annotations"
                )))
            }
            _ => Err(Error::Usage("-o names one output; use --out-dir for several inputs".to_owned())),
        };
    }
    let at = |input: &Named, below: &Path| {
        let folder = args.out_dir.as_deref().map(|folder| run::under(folder, below));
        run::default_output(&input.path, input.path.is_dir(), folder.as_deref(), is_sidecar(args, &input.path))
    };
    let mut paths: Vec<_> = inputs.iter().map(|input| at(input, &input.below)).collect();
    if args.out_dir.is_some() {
        for same in shared(&paths) {
            let places: Vec<_> = same.iter().filter_map(|&i| inputs.get(i)).collect();
            let folders = apart(&places.iter().map(|input| whole(&input.path, args.join)).collect::<Vec<_>>());
            for ((i, input), folder) in same.iter().zip(places).zip(folders) {
                if let Some(path) = paths.get_mut(*i) {
                    *path = at(input, &folder);
                }
            }
        }
    }
    let clashes = if args.join && args.sidecar { Vec::new() } else { shared(&paths) };
    let mut outputs: Vec<_> = paths.into_iter().map(free).collect();
    for same in clashes {
        for (n, &i) in same.iter().enumerate() {
            let other = same.get(if n == 0 { 1 } else { 0 }).and_then(|&other| inputs.get(other));
            let (Some(output), Some(input), Some(other)) = (outputs.get_mut(i), inputs.get(i), other) else { continue };
            let (path, other) = (output.path.display(), other.path.display());
            if args.join || !is_list {
                let input = input.path.display();
                return Err(Error::Usage(format!("{input} and {other} would both be written to {path}")));
            }
            let why = format!("would be written to {path}, as {other} would; annotate each by itself, with -o");
            output.refusal = Some(why);
        }
    }
    Ok(outputs)
}

/// Places of the paths that occur several times, by path.
fn shared(paths: &[PathBuf]) -> Vec<Vec<usize>> {
    let mut places = BTreeMap::<&Path, Vec<usize>>::new();
    for (place, path) in paths.iter().enumerate() {
        places.entry(path).or_default().push(place);
    }
    places.into_values().filter(|places| places.len() > 1).collect()
}

/// Folders of recordings without those that all of them lie in.
fn apart(recordings: &[PathBuf]) -> Vec<PathBuf> {
    let folders = |path: &PathBuf| -> Vec<_> {
        let parts = path.parent().into_iter().flat_map(Path::components);
        parts.filter(|part| matches!(part, Component::Normal(_))).map(|part| part.as_os_str().to_owned()).collect()
    };
    let folders: Vec<_> = recordings.iter().map(folders).collect();
    let first = folders.first().cloned().unwrap_or_default();
    let is_common = |i: &usize| folders.iter().all(|each| each.get(*i) == first.get(*i));
    let common = (0..first.len()).take_while(is_common).count();
    folders.iter().map(|each| each.iter().skip(common).map(AsRef::<OsStr>::as_ref).collect()).collect()
}

/// The folder of results, as the system knows it.
struct Below(Option<PathBuf>);

impl Below {
    fn of(folder: Option<&Path>) -> Self {
        Self(folder.and_then(|folder| folder.canonicalize().ok()))
    }

    /// Whether a path lies in it or below.
    fn holds(&self, path: &Path) -> bool {
        self.0.as_ref().is_some_and(|folder| path.canonicalize().is_ok_and(|path| path.starts_with(folder)))
    }
}

/// Path of an input, however it is spelled. A link is an input of its own, unless it would be joined with what it leads to.
fn whole(input: &Path, joined: bool) -> PathBuf {
    let folder = input.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let whole = match input.file_name().filter(|_| !joined) {
        _ if run::is_url(input) => None,
        Some(name) => folder.canonicalize().ok().map(|folder| folder.join(name)),
        None => input.canonicalize().ok(),
    };
    whole.unwrap_or_else(|| input.to_owned())
}

/// Whether the annotations of an input are written alone: in a store unless an output is named, since it would have to
/// hold the recording a second time.
pub fn is_sidecar(args: &cli::Annotate, input: &Path) -> bool {
    match &args.output {
        Some(output) => args.sidecar || run::is_url(output) && run::is_sidecar_name(output),
        None => args.sidecar || run::is_url(input) || args.out_dir.as_deref().is_some_and(run::is_url),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_one_name_is_told_apart_by_the_folders_that_differ() {
        let apart = |paths: &[&str]| -> Vec<String> {
            let paths: Vec<_> = paths.iter().map(PathBuf::from).collect();
            super::apart(&paths).iter().map(|folder| folder.display().to_string()).collect()
        };
        assert_eq!(apart(&["/data/s01/r.mcap", "/data/s02/r.mcap"]), ["s01", "s02"]);
        assert_eq!(apart(&["/data/r.mcap", "/data/s02/r.mcap"]), ["", "s02"]);
        assert_eq!(apart(&["s3://a/in/s01/r.mcap", "s3://b/in/s01/r.mcap"]), ["a/in/s01", "b/in/s01"]);
        assert_eq!(apart(&["/a/r.mcap", "/a/r.annotated.mcap"]), ["", ""]);
    }
}
