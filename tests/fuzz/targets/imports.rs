//! Any text is a calibration or refused, and what is understood is the same when it is exported and read back.

use arbitrary::{Result, Unstructured};
use stillpoint::report::{Axes, Format, Options, export, import};

pub fn check(bytes: &[u8]) {
    let _ = checked(&mut Unstructured::new(bytes));
}

fn checked(u: &mut Unstructured<'_>) -> Result<()> {
    let axes = *u.choose(&[None, Some(Axes::Frd), Some(Axes::Flu)])?;
    let text = text(u)?;
    let Ok(imus) = import(&text, axes) else { return Ok(()) };
    for format in Format::ALL {
        let _ = export(&imus, *format, &Options::default());
    }
    let json = Format::named("json").unwrap();
    let Ok(exported) = export(&imus, json, &Options::default()) else { return Ok(()) };
    let again = import(&exported.text, axes).expect("what was exported can be imported");
    let exported_again = export(&again, json, &Options::default()).expect("and exported again");
    assert_eq!(exported_again.text, exported.text, "of {text}");
    Ok(())
}

fn text(u: &mut Unstructured<'_>) -> Result<String> {
    let mut text = String::new();
    match u.int_in_range(0..=5)? {
        0 => {
            let (px4, slot) = (u.arbitrary()?, u.int_in_range(0..=3)?);
            for _ in 0..u.int_in_range(0..=24)? {
                let axis = u.choose(&["X", "Y", "Z"])?;
                let name = match px4 {
                    true => {
                        let (kind, what) = (u.choose(&["ACC", "GYRO"])?, u.choose(&["OFF", "SCALE"])?);
                        format!("CAL_{kind}{slot}_{axis}{what}")
                    }
                    false => format!(
                        "INS_{}{}_{axis}",
                        u.choose(&["ACC", "GYR", "ACC2", "GYR2"])?,
                        u.choose(&["OFFS", "SCAL"])?
                    ),
                };
                let name = if u.ratio(1, 6)? { (*u.choose(PARAMETERS)?).to_owned() } else { name };
                text.push_str(&format!("{name}{}{}\n", u.choose(&[",", " ", "\t"])?, number(u)?));
            }
        }
        1 => text = format!("SM: {}\nbias: {}\n", list(u)?, list(u)?),
        2 => {
            text = "imu0:\n".to_owned();
            for part in ["accelerometers", "gyroscopes"] {
                if u.ratio(3, 4)? {
                    text.push_str(&format!("  {part}:\n"));
                    for key in ["M", "b", "A", "C_gyro_i"] {
                        if u.ratio(3, 4)? {
                            text.push_str(&format!("    {key}: {}\n", list(u)?));
                        }
                    }
                }
            }
            text.push_str("  rostopic: /imu\n");
        }
        3 | 4 => text = own(u)?,
        _ => {
            for _ in 0..u.int_in_range(0..=40)? {
                text.push_str(u.choose(WORDS)?);
            }
        }
    }
    Ok(text)
}

/// Our own format, with parts that are missing or wrong.
fn own(u: &mut Unstructured<'_>) -> Result<String> {
    let mut parts = vec![format!("\"topic\": \"/a\", \"gravity\": {}", number(u)?)];
    for triad in ["\"accelerometer\": ", "\"gyroscope\": ", "\"secondary\": ["] {
        if u.ratio(1, 4)? {
            continue;
        }
        let mut keys = Vec::new();
        for key in OWN {
            if u.ratio(2, 3)? {
                let value = match u.int_in_range(0..=5)? {
                    0 => number(u)?,
                    1 => (*u.choose(&[
                        "null",
                        "\"bias-scale\"",
                        "\"triangular\"",
                        "\"cross-axis\"",
                        "\"bias\"",
                        "\"full\"",
                        "\"CONFIRMED\"",
                        "\"PROVISIONAL\"",
                        "true",
                        "{}",
                        "[]",
                    ])?)
                    .to_owned(),
                    _ => list(u)?,
                };
                keys.push(format!("\"{key}\": {value}"));
            }
        }
        parts.push(format!("{triad}{{{}}}{}", keys.join(", "), if triad.ends_with('[') { "]" } else { "" }));
    }
    Ok(format!("{{\"imus\": [{{{}}}]}}", parts.join(", ")))
}

const OWN: &[&str] = &[
    "model",
    "status",
    "bias",
    "scale",
    "sensitivity",
    "g_sensitivity",
    "g2_sensitivity",
    "rate_sensitivity",
    "bias_std",
    "sensitivity_std",
    "scale_std",
    "covariance",
    "notes",
    "rests",
    "turns",
    "noise",
    "temperature",
    "rms",
    "worst_case_error",
];

fn list(u: &mut Unstructured<'_>) -> Result<String> {
    let (length, flat) = (*u.choose(&[3, 3, 9, 9, 0, 1, 4, 12, 18])?, u.ratio(3, 4)?);
    let numbers: Vec<String> = (0..length).map(|_| number(u)).collect::<Result<_>>()?;
    let rows = numbers.chunks(3).map(|row| format!("[{}]", row.join(", ")));
    Ok(if flat { format!("[{}]", numbers.join(", ")) } else { format!("[{}]", rows.collect::<Vec<_>>().join(", ")) })
}

fn number(u: &mut Unstructured<'_>) -> Result<String> {
    Ok(match u.int_in_range(0..=9)? {
        0 => {
            (*u.choose(&["1e308", "-1e308", "5e-324", "1e-160", "0", "-0.0", "null", "1e999", "99999999999999999999"])?)
                .to_owned()
        }
        1 => {
            let any: f64 = u.arbitrary()?;
            if any.is_finite() { format!("{any:e}") } else { "1".to_owned() }
        }
        2..=5 => (*u.choose(&["1", "1.0", "0"])?).to_owned(),
        _ => format!("{}", f64::from(u.int_in_range(-2000..=2000)?) / 1000.0),
    })
}

const PARAMETERS: &[&str] = &[
    "CAL_ACC0_ROT",
    "CAL_ACC0_ID",
    "TC_A_ENABLE",
    "TC_A0_TREF",
    "TC_A0_X0_0",
    "TC_A0_X1_0",
    "TC_A0_TMIN",
    "TC_A0_TMAX",
    "TC_G_ENABLE",
    "TC_G0_X3_2",
    "INS_TCAL1_ENABLE",
    "INS_TCAL1_TMIN",
    "INS_TCAL1_TMAX",
    "INS_TCAL1_ACC1_X",
    "INS_TCAL1_GYR3_Z",
    "A",
    "_",
    "a",
];

const WORDS: &[&str] = &[
    "imus",
    ":",
    " ",
    "\n",
    "- ",
    "[",
    "]",
    "{",
    "}",
    "\"",
    "'",
    ",",
    "&a ",
    "*a",
    "!!binary ",
    "|",
    ">",
    "?",
    "#",
    "1",
    ".nan",
    "SM",
    "bias",
    "imu0",
    "accelerometers",
    "M",
    "  ",
    "\t",
    "---\n",
    "...\n",
    "<<: ",
    "é",
    "\u{0}",
    "~",
];
