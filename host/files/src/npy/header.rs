//! Parser for the Python dictionary in an `.npy` header.

use super::NpyError;

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Header {
    /// NumPy's type name, e.g. `<f4`.
    pub descr: String,
    /// Whether the first axis varies fastest.
    pub fortran_order: bool,
    pub shape: Vec<usize>,
}

impl Header {
    pub fn parse(bytes: &[u8]) -> Result<Self, NpyError> {
        let mut text = Text { bytes, at: 0 };
        let (mut descr, mut fortran_order, mut shape) = (None, None, None);
        text.must(b'{', "{")?;
        while !text.has(b'}') {
            let (at, key) = (text.at, text.quoted("a quoted name")?);
            text.must(b':', "a colon")?;
            match key {
                b"descr" => descr = Some(text.quoted("the quoted name of one kind of value")?),
                b"fortran_order" => fortran_order = Some(text.truth()?),
                b"shape" => shape = Some(text.lengths()?),
                _ => return Err(NpyError::Header { at, expected: "descr, fortran_order or shape" }),
            }
            if !text.has(b',') {
                text.must(b'}', "a comma or }")?;
                break;
            }
        }
        text.skip_blanks();
        if text.at < bytes.len() {
            return text.fail("its end");
        }
        let missing = |key| NpyError::Missing { key };
        Ok(Self {
            descr: String::from_utf8_lossy(descr.ok_or(missing("descr"))?).into_owned(),
            fortran_order: fortran_order.ok_or(missing("fortran_order"))?,
            shape: shape.ok_or(missing("shape"))?,
        })
    }
}

struct Text<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Text<'a> {
    fn fail<T>(&self, expected: &'static str) -> Result<T, NpyError> {
        Err(NpyError::Header { at: self.at, expected })
    }

    fn skip_blanks(&mut self) {
        self.at += self.bytes[self.at..].iter().take_while(|byte| byte.is_ascii_whitespace()).count();
    }

    /// Skips the next mark if it is this one.
    fn has(&mut self, mark: u8) -> bool {
        self.skip_blanks();
        let found = self.bytes.get(self.at) == Some(&mark);
        self.at += usize::from(found);
        found
    }

    fn must(&mut self, mark: u8, expected: &'static str) -> Result<(), NpyError> {
        if self.has(mark) { Ok(()) } else { self.fail(expected) }
    }

    /// Quoted text; NumPy's names need no escapes.
    fn quoted(&mut self, expected: &'static str) -> Result<&'a [u8], NpyError> {
        self.skip_blanks();
        let rest = &self.bytes[self.at..];
        let Some((quote @ (b'\'' | b'"'), name)) = rest.split_first() else { return self.fail(expected) };
        let Some(length) = name.iter().position(|byte| byte == quote) else { return self.fail(expected) };
        self.at += length + 2;
        Ok(&name[..length])
    }

    fn truth(&mut self) -> Result<bool, NpyError> {
        self.skip_blanks();
        let rest = &self.bytes[self.at..];
        let Some((word, truth)) =
            [(&b"True"[..], true), (b"False", false)].into_iter().find(|(word, _)| rest.starts_with(word))
        else {
            return self.fail("True or False");
        };
        self.at += word.len();
        Ok(truth)
    }

    fn lengths(&mut self) -> Result<Vec<usize>, NpyError> {
        self.must(b'(', "(")?;
        let mut lengths = Vec::new();
        while !self.has(b')') {
            lengths.push(self.length()?);
            if !self.has(b',') {
                self.must(b')', "a comma or )")?;
                break;
            }
        }
        Ok(lengths)
    }

    fn length(&mut self) -> Result<usize, NpyError> {
        self.skip_blanks();
        let rest = &self.bytes[self.at..];
        let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let number = str::from_utf8(&rest[..digits]).ok().and_then(|digits| digits.parse().ok());
        let Some(number) = number else { return self.fail("the length of an axis") };
        self.at += digits;
        // Suffix of long integers in Python 2.
        self.at += usize::from(self.bytes.get(self.at) == Some(&b'L'));
        Ok(number)
    }
}
