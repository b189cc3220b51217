//! Tables of spectra as laboratories write them, kind by kind: each is read right, or refused with what to do.

use super::{columns_of, tensor, wavelengths};
use std::f64::consts::PI;
use wavelume_core::domain::Quantity;
use wavelume_formats::formats::{Interpretation, NoteKind, Overlap, read};

/// Wavelengths of all tables here in nm, and their values as a fraction.
const NM: [f64; 6] = [400.0, 410.0, 420.0, 430.0, 440.0, 450.0];
const VALUES: [f32; 6] = [0.08, 0.12, 0.3, 0.58, 0.21, 0.1];

/// Writes a table whose rows hold the wavelength `{nm}`, the row's number `{n}`, the value `{v}`, and the same in
/// percent `{p}`.
fn table(header: &str, row: &str, after: &str) -> String {
    let rows = NM.iter().zip(VALUES).enumerate().map(|(i, (nm, value))| {
        let percent = format!("{}", (value * 100.0).round());
        row.replace("{nm}", &nm.to_string())
            .replace("{um}", &(nm / 1000.0).to_string())
            .replace("{n}", &(i + 1).to_string())
            .replace("{p}", &percent)
            .replace("{v,}", &value.to_string().replace('.', ","))
            .replace("{v}", &value.to_string())
    });
    format!("{header}\n{}\n{after}", rows.collect::<Vec<_>>().join("\n"))
}

/// Checks that a text is read as one spectrum of [`VALUES`].
fn check(text: &str, how: &Interpretation, quantity: Quantity) {
    let found = read(text.as_bytes(), how).unwrap_or_else(|error| panic!("{text}{error}"));
    assert_eq!((wavelengths(&found), found.quantity), (NM.to_vec(), quantity), "{text}");
    let values = columns_of(&found);
    assert_eq!(values.len(), 1, "{text}: {:?}", tensor(&found).0);
    let near = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-6;
    assert!(values[0].iter().zip(&VALUES).all(near), "{text}: {values:?}");
}

#[test]
fn wavelengths_are_found_wherever_they_stand() {
    for (header, row) in [
        ("No,Wavelength (nm),R%", "{n},{nm},{p}"),
        ("Pixel;Wellenlänge [nm];Reflexionsgrad", "{n};{nm};{v,}"),
        ("Time (ms),Wavelength,Reflectance", "40{n},{nm},{v}"),
        ("Reflectance\tWavelength (um)", "{v}\t{um}"),
        (",wavelength,reflectance", "{n},{nm},{v}"),
        ("Unnamed: 0,lambda,T [%]", "{n},{nm},{p}"),
        ("\"wl\",\"Reflectance\"", "\"{n}\",{nm},{v}"),
        ("band,wavelength,fwhm,albedo", "{n},{nm},10,{v}"),
    ] {
        check(&table(header, row, ""), &Interpretation::default(), Quantity::Reflectance);
    }
    for text in ["Thickness (nm),R%", "Year,Reflectance", "Channel,Counts", "Grain size (um),R%", "Distance (mm),W/m2"]
    {
        let error = read(table(text, "{nm},{p}", "").as_bytes(), &Interpretation::default()).unwrap_err().to_string();
        assert!(error.contains("wavelength_column") && !error.contains("wavelength_unit"), "{text}: {error}");
    }
    let alike = "400 500 600\n410 510 610\n420 520 620\n";
    let found = read(alike.as_bytes(), &Interpretation::default()).unwrap();
    assert!(super::has_note(&found, NoteKind::Assumed, "the first is taken"));
    let named = Interpretation { wavelength_column: Some("2".to_owned()), ..Interpretation::default() };
    assert_eq!(wavelengths(&read(alike.as_bytes(), &named).unwrap()), [500.0, 510.0, 520.0]);
}

#[test]
fn quantities_and_percent_belong_to_columns() {
    for (header, row) in [
        ("Wave;Sample;Dark;Reference;Reflectance\n[nm];[counts];[counts];[counts];[%]", "{nm};4000;90;52000;{p}"),
        ("wavelength,white,dark,sample,reflectance", "{nm},52000,90,4000,{v}"),
        ("Wavelength,Reflectance,Std", "{nm},{v},0.01"),
        ("nm,R (%),Temperature (C)", "{nm},{p},23.1"),
        ("nm,%T", "{nm},{p}"),
        ("Wavelength (nm),R [%] SCI", "{nm},{p}"),
        ("Longueur d'onde (nm);Réflexion (%)", "{nm};{p}"),
        ("Wavelength (nm),ρ(λ) [%]", "{nm},{p}"),
        ("wl,Reflectance", "{nm},{p}%"),
        ("TITLE\tx\nXUNITS\tNANOMETERS\nYUNITS\t%R\nXYDATA", "{nm}\t{p}"),
        ("# Diffuse reflectance in percent\nnm,leaf", "{nm},{p}"),
    ] {
        check(&table(header, row, ""), &Interpretation::default(), Quantity::Reflectance);
    }
    let counts = table("nm,Counts,R%", "{nm},{v},{p}", "");
    let how = Interpretation { column: Some("Counts".to_owned()), ..Interpretation::default() };
    check(&counts, &how, Quantity::Spectrum);
    for (header, word) in [
        ("Wvl,Rad. (Target),Reflect. %", "1 `Rad. (Target)`"),
        ("nm,sd,Absorbance", "10^-A"),
        ("nm,Dark [counts],Extinktion", "10^-A"),
        ("nm,n,k", "refractive"),
    ] {
        let error = read(table(header, "{nm},{v},{p}", "").as_bytes(), &Interpretation::default()).unwrap_err();
        assert!(error.to_string().contains(word), "{header}: {error}");
    }
    let factors = read(table("nm,HCRF (%)", "{nm},{p}", "").as_bytes(), &Interpretation::default()).unwrap();
    assert!((columns_of(&factors)[0][0] - (0.08 / PI) as f32).abs() < 1e-6);
}

#[test]
fn quotes_text_below_and_rulers_are_no_obstacle() {
    for (header, row, after) in [
        ("\"Wavelength, nm\";\"R, %\"", "\"{nm}\";\"{p},0\"", ""),
        ("\"nm\",\"Reflectance\"", "\"{nm}\",\"{v,}\"", ""),
        ("'nm','Reflectance'", "'{nm}','{v}'", ""),
        ("nm,R%,remark", "{nm},{p},\"ok, fine\"", ""),
        ("Wavelength   Reflectance\n--------------------", "{nm}   {v}", ""),
        ("nm,R%", "{nm},{p}", ": 5\n"),
        ("nm,R%", "{nm},{p}", "\nInstrument,Cary 5000\nScan rate,600.000\n"),
        ("nm\tR%", "{nm}\t{p}", "##### Extended Information\n[Comments]\nSample name\tx\n"),
        ("sep=;\nnm;R%", "{nm};{p}", ""),
    ] {
        check(&table(header, row, after), &Interpretation::default(), Quantity::Reflectance);
    }
    let error = read(b"nm,counts\n400,\"1,200\"\n410,\"1,300\"\n", &Interpretation::default());
    assert!(error.is_err(), "a comma between thousands is no decimal mark");
}

#[test]
fn pairs_and_named_bands_are_spectra_of_their_own() {
    for text in [
        "leaf,,soil,\nWavelength (nm),%R,Wavelength (nm),%R,\n420,3,420,6,\n410,2,410,5,\n400,1,400,4,\n\nleaf\nx\n",
        "sample,400.00 nm,410.00 nm,420.00 nm\nleaf (%R),1,2,3\nsoil,4,5,6\n",
        "sample,X400,X410,X420\nleaf,1,2,3\nsoil,4,5,6\n",
        "sample,0.40 um,0.41 um,0.42 um\nleaf,1,2,3\nsoil,4,5,6\n",
        "nm\tleaf\t\tnm\tsoil\n400\t1\t\t400\t4\n410\t2\t\t410\t5\n420\t3\t\t420\t6\n",
    ] {
        let found = read(text.as_bytes(), &Interpretation::default()).unwrap_or_else(|error| panic!("{text}{error}"));
        let scale = if found.quantity == Quantity::Reflectance { 100.0 } else { 1.0 };
        let values: Vec<Vec<f32>> =
            columns_of(&found).iter().map(|row| row.iter().map(|v| (v * scale).round()).collect()).collect();
        assert_eq!(wavelengths(&found), [400.0, 410.0, 420.0], "{text}");
        assert_eq!(values, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "{text}");
    }
    let other = "nm,A,nm,B\n400,1,405,4\n410,2,415,5\n420,3,425,6\n";
    assert!(read(other.as_bytes(), &Interpretation::default()).unwrap_err().to_string().contains("with column"));
    let how = Interpretation { column: Some("B".to_owned()), ..Interpretation::default() };
    assert_eq!(wavelengths(&read(other.as_bytes(), &how).unwrap()), [405.0, 415.0, 425.0]);
}

#[test]
fn three_detectors_are_joined_pairwise() {
    let rows = [(400, 0.1), (470, 0.2), (540, 0.3)]
        .into_iter()
        .flat_map(|(from, value)| (0..10).map(move |step| format!("{},{value}\n", from + 10 * step)));
    let text = "Wavelength (nm),Reflectance\n".to_owned() + &rows.collect::<Vec<_>>().concat();
    for (overlap, expected) in
        [(None, [0.1, 0.2, 0.3]), (Some(Overlap::Longer), [0.2, 0.3, 0.3]), (Some(Overlap::Mean), [0.15, 0.25, 0.3])]
    {
        let found = read(text.as_bytes(), &Interpretation { overlap, ..Interpretation::default() }).unwrap();
        let at = |nm: f64| tensor(&found).1[wavelengths(&found).iter().position(|&other| other == nm).unwrap()];
        assert_eq!(wavelengths(&found).len(), 24);
        assert_eq!([at(480.0), at(550.0), at(640.0 - 10.0)], expected, "{overlap:?}");
        assert!(super::has_note(&found, NoteKind::Assumed, "ranges of two detectors overlap"));
    }
}

#[test]
fn prose_lists_and_markdown_are_no_tables() {
    // A sentence with as many commas as the rows have columns names none of them.
    let text = "# reflectance in 1, wavelengths in nm\n400 0.1\n410 0.2\n420 0.3\n430 0.25\n";
    assert_eq!(wavelengths(&read(text.as_bytes(), &Interpretation::default()).unwrap()), [400.0, 410.0, 420.0, 430.0]);
    for text in [
        "# Files\n\n| nm | R |\n|---|---|\n| 400 | 0.1 |\n| 410 | 0.2 |\n",
        "* file 1, 400 lines, 2020\n* file 2, 410 lines, 2021\n",
        "2024-01-01 10:00 INFO step 400 0.1\n2024-01-01 10:01 INFO step 410 0.2\n",
    ] {
        let error = read(text.as_bytes(), &Interpretation::default()).unwrap_err().to_string();
        assert!(error.contains("no format known"), "{text}: {error}");
    }
}
