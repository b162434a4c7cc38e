use super::*;

fn load(bytes: impl AsRef<[u8]>) -> Result<Parts, Vec<Issue>> {
    read(Path::new("x.ply"), bytes.as_ref())
}

/// A square with an element between vertices and faces, and with properties beside those that are read.
fn header(format: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment by hand\nobj_info none\nelement vertex 4\n\
         property double x\nproperty float y\nproperty uchar red\nproperty short z\n\
         element camera 2\nproperty list uchar int views\nproperty int id\n\
         element face 2\nproperty list uchar int vertex_indices\nproperty uchar flags\nend_header\n"
    )
}

fn text() -> String {
    header("ascii") + "0 0 9 0\n1 0 9 0\n1 1 9 -2\n0 1 9 0\n2 7 7 1\n0 2\n4 0 1 2 3 1\n3 0 2 1 0\n"
}

fn binary(big: bool) -> Vec<u8> {
    let mut out =
        header(if big { "binary_big_endian" } else { "binary_little_endian" }).into_bytes();
    macro_rules! put {
        ($v:expr) => {
            out.extend(if big { $v.to_be_bytes() } else { $v.to_le_bytes() })
        };
    }
    for [x, y, z] in [[0, 0, 0], [1, 0, 0], [1, 1, -2], [0, 1, 0i16]] {
        put!(f64::from(x));
        put!(f32::from(y));
        put!(9u8);
        put!(z);
    }
    put!(2u8);
    for v in [7i32, 7, 1] {
        put!(v);
    }
    put!(0u8);
    put!(2i32);
    for corners in [&[0i32, 1, 2, 3][..], &[0, 2, 1]] {
        put!(corners.len() as u8);
        corners.iter().for_each(|v| put!(v));
        put!(1u8);
    }
    out
}

#[test]
fn every_encoding_gives_the_same_square() {
    let crlf = text().replace('\n', "\r\n").into_bytes();
    let cr = text().replace('\n', "\r").into_bytes();
    // MeshLab writes more colours than its header has.
    let more = text().replace("3 1\n", "3 1 0.5 0.5\n").into_bytes();
    for bytes in [text().into_bytes(), crlf, cr, more, binary(false), binary(true)] {
        let parts = load(&bytes).expect("readable");
        let soup = &parts.parts[0];
        assert_eq!(soup.positions[2], [1.0, 1.0, -2.0]);
        assert_eq!(soup.triangles, [[0, 1, 2], [0, 2, 3], [0, 2, 1]]);
        assert!(parts.issues.is_empty(), "{:?}", parts.issues);
    }
}

#[test]
fn strips_of_triangles_alternate() {
    let text = text().replace("element face", "element tristrips");
    let text = text.replace("4 0 1 2 3 1\n3 0 2 1 0\n", "7 0 1 2 3 -1 0 1 0\n3 0 2 1 0\n");
    let parts = load(text).expect("readable");
    assert_eq!(parts.parts[0].triangles, [[0, 1, 2], [2, 1, 3], [0, 2, 1]]);
    assert_eq!(parts.issues.len(), 1, "a strip of two corners");
}

#[test]
fn planted_faults_are_named() {
    let text = text();
    for (from, to, cause) in [
        ("ply\n", "play\n", "is no PLY file"),
        ("format ascii", "format packed", "no format that PLY has"),
        ("element vertex 4", "element vertex 400000000", "are too many"),
        ("element vertex 4", "element vertex x", "line 5: `element vertex x`"),
        ("element camera 2", "element camera 90000000000", "`vertex_indices`|ends within"),
        ("double x", "quad x", "no type of PLY"),
        ("property float y\n", "", "without x, y and z"),
        ("end_header\n", "", "is not understood"),
        ("3 0 2 1 0", "3 0 2 4 0", "vertex 4, counted from 0, and there are 4"),
        ("3 0 2 1 0", "3 0 2 -1 0", "vertex -1"),
        ("3 0 2 1 0", "3000 0 2 1 0", "ends within the faces"),
        ("element face 2", "element face 3", "at number 3 of 3 by its header"),
        ("3 0 2 1 0", "-3 0 2 1 0", "a list of -3 values"),
        ("1 0 9 0\n", "1 x 9 0\n", "line 18: `x` is no number"),
    ] {
        let broken = text.replace(from, to);
        assert_ne!(broken, text);
        let issues = load(broken).expect_err(cause);
        let message = issues[0].to_string();
        assert!(cause.split('|').any(|cause| message.contains(cause)), "{cause}: {message}");
    }
    let whole = binary(false);
    for cut in [whole.len() - 1, whole.len() - 20, header("ascii").len()] {
        assert!(load(&whole[..cut]).is_err());
    }
}
