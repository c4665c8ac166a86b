//! The program without object stores.

use crate::common::Folder;

#[test]
#[ignore = "of a program that was built without them, which STILLPOINT_PROGRAM names: .ci/release tries it"]
fn a_url_is_refused_in_one_line_that_says_what_to_do() {
    let folder = Folder::with_demo();
    let told = ["built without object stores", "--features object-store", "pip install stillpoint"];
    for line in [
        "annotate s3://bucket/x.mcap",
        "annotate az://container/prefix/",
        "annotate demo.mcap --out-dir gs://bucket/out",
        "topics https://host/x.mcap",
        "report s3://bucket/x.mcap",
        "export s3://bucket/x.mcap --format json",
        "export demo.mcap --format json -o s3://bucket/x.json",
        "merge s3://bucket/prefix/",
        "watch s3://bucket/prefix",
    ] {
        folder.refuses(line, 2, &told);
    }
}
