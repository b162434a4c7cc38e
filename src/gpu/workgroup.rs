//! Shared memory of a kernel, summed from its SPIR-V: a device that has less fails in unpredictable ways.

use std::collections::HashMap;

/// Size of a type, or the type that it points to.
#[derive(Clone, Copy)]
enum SharedType {
    Bytes(u64),
    /// Pointer to a type in shared memory.
    Shared(u32),
}

/// Number of bytes of all variables in shared memory. `value_of` gives constants by their id, as specialized.
/// The error is a sentence without the kernel's name.
pub(crate) fn shared_bytes(words: &[u32], value_of: &HashMap<u32, u32>) -> Result<u32, String> {
    const OP_TYPE_BOOL: u32 = 20;
    const OP_TYPE_INT: u32 = 21;
    const OP_TYPE_FLOAT: u32 = 22;
    const OP_TYPE_VECTOR: u32 = 23;
    const OP_TYPE_MATRIX: u32 = 24;
    const OP_TYPE_ARRAY: u32 = 28;
    const OP_TYPE_STRUCT: u32 = 30;
    const OP_TYPE_POINTER: u32 = 32;
    const OP_VARIABLE: u32 = 59;
    const WORKGROUP: u32 = 4;

    let mut types: HashMap<u32, SharedType> = HashMap::new();
    let mut sum = 0u64;
    let mut at = 5; // after the header
    while let Some(&first) = words.get(at) {
        let (length, op) = ((first >> 16) as usize, first & 0xffff);
        let Some(w) = words.get(at..at + length).filter(|w| !w.is_empty()) else {
            break;
        };
        at += length;
        let bytes = |id: &u32| match types.get(id) {
            Some(SharedType::Bytes(bytes)) => Some(*bytes),
            _ => None,
        };
        let (id, made) = match (op, w) {
            (OP_TYPE_BOOL, &[_, id]) => (id, Some(4)),
            (OP_TYPE_INT | OP_TYPE_FLOAT, &[_, id, bits, ..]) => (id, Some(u64::from(bits) / 8)),
            (OP_TYPE_VECTOR | OP_TYPE_MATRIX, &[_, id, of, count]) => {
                (id, bytes(&of).map(|each| each * u64::from(count)))
            }
            (OP_TYPE_ARRAY, &[_, id, of, count]) => {
                let count = value_of.get(&count).copied().map(u64::from);
                (id, bytes(&of).zip(count).and_then(|(b, n)| b.checked_mul(n)))
            }
            (OP_TYPE_STRUCT, &[_, id, ref members @ ..]) => (id, members.iter().map(bytes).sum()),
            (OP_TYPE_POINTER, &[_, id, WORKGROUP, to]) => {
                types.insert(id, SharedType::Shared(to));
                continue;
            }
            (OP_VARIABLE, &[_, pointer, _, WORKGROUP, ..]) => {
                let pointed = match types.get(&pointer) {
                    Some(SharedType::Shared(to)) => bytes(to),
                    _ => None,
                };
                sum += pointed.ok_or("the size of its shared memory is no plain constant")?;
                continue;
            }
            _ => continue,
        };
        if let Some(made) = made {
            types.insert(id, SharedType::Bytes(made));
        }
    }
    u32::try_from(sum).map_err(|_| format!("its shared memory takes {sum} bytes"))
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::shared_bytes;

    /// A float array of constant 7's length and a counter beside it, in shared memory.
    fn module() -> Vec<u32> {
        let op = |code: u32, words: &[u32]| {
            let mut all = vec![(words.len() as u32 + 1) << 16 | code];
            all.extend(words);
            all
        };
        let instructions = [
            op(22, &[1, 32]),    // float
            op(23, &[2, 1, 4]),  // vec4
            op(28, &[3, 2, 7]),  // vec4[constant 7]
            op(30, &[4, 3, 1]),  // struct of both
            op(32, &[5, 4, 4]),  // pointer to it (4), shared (4)
            op(32, &[6, 7, 4]),  // the same, private
            op(59, &[5, 8, 4]),  // shared variable
            op(59, &[6, 9, 7]),  // private variable
            op(32, &[10, 4, 1]), // pointer to a float
            op(59, &[10, 11, 4]),
        ];
        let mut words = vec![0; 5];
        words.extend(instructions.concat());
        words
    }

    #[test]
    fn shared_variables_are_summed_as_specialized() {
        let bytes = |length| shared_bytes(&module(), &HashMap::from([(7, length)]));
        assert_eq!(bytes(10), Ok(16 * 10 + 4 + 4));
        assert_eq!(bytes(1024), Ok(16 * 1024 + 4 + 4));
        assert!(shared_bytes(&module(), &HashMap::new()).is_err());
        assert!(bytes(u32::MAX).is_err(), "more than any device has");
    }
}
