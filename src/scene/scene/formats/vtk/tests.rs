use super::*;

fn load(bytes: impl AsRef<[u8]>) -> Result<Parts, Vec<Issue>> {
    read(Path::new("x.vtk"), bytes.as_ref())
}

const HEAD: &str = "# vtk DataFile Version 4.2\n3D Slicer output. SPACE=LPS\n";
const POINTS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, -2.0], [0.0, 1.0, 0.0]];

fn text() -> String {
    format!(
        "{HEAD}ASCII\nDATASET POLYDATA\nFIELD FieldData 2\nwhen 1 2 double\n1 2\n\
         SPACE 1 1 string\nLPS of a patient\nPOINTS 4 float\n0 0 0 1 0 0\n1 1 -2 0 1 0\n\
         METADATA\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 3\n\n\
         VERTICES 1 2\n1 0\nLINES 1 3\n2 0 1\nPOLYGONS 2 9\n4 0 1 2 3\n3 0 2 1\n\
         TRIANGLE_STRIPS 1 5\n4 0 1 2 3\nPOINT_DATA 4\nrest\n"
    )
}

/// The same in binary; `five`: with offsets and connectivity.
fn binary(five: bool) -> Vec<u8> {
    let mut out = HEAD.replace("4.2", if five { "5.1" } else { "4.2" }).into_bytes();
    out.extend(b"BINARY\nDATASET POLYDATA\nFIELD FieldData 2\nwhen 1 2 double\n");
    out.extend([1.0f64, 2.0].iter().flat_map(|v| v.to_be_bytes()));
    out.extend(b"\nSPACE 1 1 string\n\xc3LPS\nPOINTS 4 float\n");
    out.extend(POINTS.iter().flatten().flat_map(|v| v.to_be_bytes()));
    out.extend(b"\nMETADATA\nINFORMATION 0\n\n");
    for (name, cells) in [
        ("LINES", &[&[0, 1][..]][..]),
        ("POLYGONS", &[&[0, 1, 2, 3], &[0, 2, 1]]),
        ("TRIANGLE_STRIPS", &[&[0, 1, 2, 3]]),
    ] {
        let corners: usize = cells.iter().map(|cell| cell.len()).sum();
        let all = cells.iter().copied().flatten();
        if five {
            out.extend(format!("{name} {} {corners}\n", cells.len() + 1).bytes());
            out.extend(b"OFFSETS vtktypeint64\n");
            let mut at = 0i64;
            out.extend(at.to_be_bytes());
            for cell in cells {
                at += cell.len() as i64;
                out.extend(at.to_be_bytes());
            }
            out.extend(b"\nCONNECTIVITY vtktypeint64\n");
            out.extend(all.flat_map(|&v: &i32| i64::from(v).to_be_bytes()));
        } else {
            out.extend(format!("{name} {} {}\n", cells.len(), corners + cells.len()).bytes());
            for cell in cells {
                out.extend((cell.len() as i32).to_be_bytes());
                out.extend(cell.iter().flat_map(|v| v.to_be_bytes()));
            }
        }
        out.push(b'\n');
    }
    out
}

#[test]
fn every_encoding_gives_the_same_surface() {
    for bytes in [
        text().into_bytes(),
        text().replace('\n', "\r\n").into_bytes(),
        binary(false),
        binary(true),
    ] {
        let parts = load(&bytes).unwrap_or_else(|e| panic!("{e:?}"));
        let soup = &parts.parts[0];
        assert_eq!(soup.positions, POINTS);
        let square = [[0, 1, 2], [0, 2, 3], [0, 2, 1]];
        assert_eq!(soup.triangles, [&square[..], &[[0, 1, 2], [2, 1, 3]]].concat());
        assert!(parts.issues.is_empty(), "{:?}", parts.issues);
    }
}

#[test]
fn planted_faults_are_named() {
    let text = text();
    for (from, to, cause) in [
        ("# vtk", "# vdk", "is no VTK file"),
        ("ASCII", "UTF-8", "line 3: is neither ASCII nor BINARY"),
        ("POLYDATA", "UNSTRUCTURED_GRID", "holds a dataset `UNSTRUCTURED_GRID`"),
        ("POLYDATA", "UNSTRUCTURED_GRID", "Extract Surface"),
        ("POLYDATA", "structured_points", "it is a volume"),
        ("POINTS 4", "POINTS 5000000", "too many"),
        ("POINTS 4", "POINTS 4000000000", "too many"),
        ("POINTS 4 float", "POINTS 4 quad", "line 10: `quad` is no type"),
        ("1 1 -2", "1 x -2", "line 12: `x` is no number"),
        ("2 9\n4 0", "2 9\n7 0", "more corners than are there"),
        ("2 9\n4 0", "2 9\n-4 0", "more corners than are there"),
        ("3 0 2 1", "3 0 4 1", "vertex 4, counted from 0, and there are 4"),
        ("3 0 2 1", "3 0 -2 1", "vertex -2"),
        ("POLYGONS", "PENTAGONS", "`PENTAGONS` is no part of polydata"),
    ] {
        let broken = text.replace(from, to);
        assert_ne!(broken, text, "{from}");
        let message = load(broken).expect_err(cause)[0].to_string();
        assert!(message.contains(cause), "{cause}: {message}");
    }
    let whole = binary(true);
    for cut in [whole.len() - 2, whole.len() - 40, 150] {
        assert!(load(&whole[..cut]).is_err());
    }
}
