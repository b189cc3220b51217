//! Words of the trade: what `inspect` and `physics` say of luminaires.

use super::{at, done, json, root};

fn fixture(name: &str) -> String {
    root().join("tests/fixtures").join(name).display().to_string()
}

#[test]
fn inspect_says_what_the_file_knows() {
    let dir = tempfile::tempdir().unwrap();
    let out = at(&dir, "lamp.wlm");
    done(&["compress", &fixture("ldt/example.ldt"), "-o", &out]);
    let text = done(&["inspect", &out]);
    for line in [
        "maker           Ingemann\n",
        "name            Prolicht E30-0019 - AGP + I-Diff 20 Combined\n",
        "lamp lumens     5134 lm\n",
        "power           60.22 W\n",
        "colour          3008\n",
        "date            26/09/2019 - Viso LabSpion\n",
    ] {
        let [label, value] = line.trim_end().split_once("  ").map(|(a, b)| [a, b.trim()]).unwrap();
        let found = text.lines().find(|line| line.trim_start().starts_with(&format!("{label}  ")));
        assert_eq!(found.map(|line| line.trim()[label.len()..].trim()), Some(value), "{text}");
    }
    let product = &json(&["inspect", &out, "--json"])["product"];
    assert_eq!((product["maker"].as_str(), product["watts"].as_f64()), (Some("Ingemann"), Some(60.22)));
    assert_eq!(product["instrument"], serde_json::Value::Null);
}

#[test]
fn physics_states_the_figures_of_a_luminaire() {
    let dir = tempfile::tempdir().unwrap();
    let out = at(&dir, "lamp.wlm");
    done(&["compress", &fixture("ldt/example.ldt"), "-o", &out, "--lossless"]);
    let report = json(&["physics", &out, "--json"]);
    let lamp = &report["luminaire"][0];
    let flux = lamp["flux"].as_f64().unwrap();
    // The reader of the file sums 5136.1 lm.
    assert!((flux / 5136.1 - 1.0).abs() < 1e-4, "{flux}");
    assert_eq!(report["energy"]["flux"][0]["luminous"], lamp["flux"]);
    let zones: Vec<f64> = lamp["zones"].as_array().unwrap().iter().map(|zone| zone["flux"].as_f64().unwrap()).collect();
    assert!(zones.len() == 6 && (zones.iter().sum::<f64>() / flux - 1.0).abs() < 1e-6, "{zones:?}");
    assert!((lamp["efficacy"].as_f64().unwrap() / (flux / 60.22) - 1.0).abs() < 1e-9);
    assert!((lamp["light_output_ratio"].as_f64().unwrap() / (flux / 5134.0) - 1.0).abs() < 1e-9);
    let text = done(&["physics", &out]);
    for word in ["peak ", "C0-C180 ", "C90-C270 ", "beam ", "zones ", "gamma 120–180°", "lm/W with the 60.22 W"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    for absent in ["UGR", "BUG", "glare"] {
        assert!(!text.contains(absent), "{text}");
    }
    // Absolute photometry and no watts: no ratio, no efficacy.
    done(&["compress", &fixture("ies/photometric-viewer/absolute_photometry.ies"), "-o", &out, "--lossless"]);
    let lamp = &json(&["physics", &out, "--json"])["luminaire"][0];
    assert_eq!(
        (&lamp["light_output_ratio"], &lamp["lamp_lumens"]),
        (&serde_json::Value::Null, &serde_json::Value::Null)
    );
}
