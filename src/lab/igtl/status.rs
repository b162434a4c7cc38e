//! Counts of a server's events so far, and the reason for which the probe stays.

/// Counts of events so far.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Clients that take room now.
    pub clients: usize,
    /// Clients that were let in.
    pub accepted: u64,
    /// Clients for which there was no room.
    pub refused: u64,
    /// Messages that were understood.
    pub messages: u64,
    /// Poses of the tool that moves the probe, including those where the tracker did not see it.
    pub poses: u64,
    /// Messages of other tools and of types that are skipped.
    pub ignored: u64,
    /// Tools that move nothing and types that are not read, the first ones that came: `Stylus (TRANSFORM)`.
    pub others: Vec<String>,
    /// Messages without a checksum.
    pub unchecked: u64,
    /// Images that clients took.
    pub images_sent: u64,
    /// Images that were not sent to clients because they were still taking an older one.
    pub images_dropped: u64,
    /// Faulty messages and connections.
    pub errors: u64,
    /// The last of them: client and fault.
    pub last_error: Option<String>,
}

/// Most tools and types that are kept of those that move nothing.
const MOST_OTHERS: usize = 8;

impl Status {
    /// Keeps what has come and moves nothing.
    pub(super) fn hear(&mut self, what: &str) {
        if self.others.len() < MOST_OTHERS && !self.others.iter().any(|other| other == what) {
            self.others.push(what.to_owned());
        }
    }

    /// The reason for which nothing moves the probe although messages come in: tools of other names, types that are not
    /// read. `wanted` is the name that is waited for, where there is one.
    pub fn silence(&self, wanted: Option<&str>) -> Option<String> {
        if self.poses > 0 || self.others.is_empty() {
            return None;
        }
        let waited = match wanted {
            Some(name) => {
                format!("the [tracker]'s device `{name}` as TRANSFORM, TDATA, POSITION or QTDATA")
            }
            None => "a tool as TRANSFORM, TDATA, POSITION or QTDATA".to_owned(),
        };
        Some(format!(
            "nothing moves the probe: {} came, and {waited} is waited for",
            self.others.join(", ")
        ))
    }
}
