//! Reading elements of arrays: in the `reads` of an array, `T[i-1]` is the element before that of the reader. The
//! letters i, j, k, … are the reader's own subscripts; a subscript may also be a number, or `:` for all.

use std::borrow::Cow;
use std::ops::Range;

/// The letters, one for each of the 16 dimensions that an array may have.
const FIRST_LETTER: u8 = b'i';
const LETTERS: usize = 16;

#[derive(Clone)]
enum Subscript {
    /// A number, from 1.
    Fixed(usize),
    /// The reader's own subscript in a dimension, plus an offset.
    Own {
        dimension: usize,
        offset: isize,
    },
    All,
}

/// An entry of `reads`: the name of what it reads, and subscripts unless it reads a whole variable.
pub(crate) struct Read<'a> {
    pub(crate) name: Cow<'a, str>,
    text: &'a str,
    subscripts: Vec<Subscript>,
}

/// The element that reads: the indices of its component in arrays of components, and the sizes of its variable.
#[derive(Clone, Copy)]
pub(crate) struct Reader<'a> {
    pub(crate) components: &'a [usize],
    pub(crate) sizes: &'a [usize],
}

/// The positions that the elements of an array read.
pub(crate) enum Found<'n> {
    /// The positions that every element reads.
    Alike(&'n [usize]),
    Each(Vec<Vec<usize>>),
}

impl Found<'_> {
    /// The positions that an element reads.
    pub(crate) fn of(&self, element: usize) -> &[usize] {
        match self {
            Self::Alike(positions) => positions,
            Self::Each(positions) => &positions[element],
        }
    }
}

impl<'a> Read<'a> {
    /// A whole variable, whatever its name.
    pub(crate) fn whole(name: &'a str) -> Self {
        Self { name: name.into(), text: name, subscripts: Vec::new() }
    }

    /// What a text may mean: brackets before the last may belong to the names of components, or be subscripts of arrays
    /// of components.
    pub(crate) fn all(text: &'a str) -> Result<Vec<Self>, String> {
        let (mut name, mut groups, mut rest) = (String::new(), Vec::new(), text);
        let mut starts = Vec::new();
        while let Some((before, inside, after)) = rest
            .split_once('[')
            .and_then(|(before, rest)| rest.split_once(']').map(|(inside, after)| (before, inside, after)))
        {
            name += before;
            starts.push(text.len() - rest.len() + before.len());
            let subscripts = inside.split(',').map(|subscript| Subscript::new(subscript.trim()));
            groups.push(subscripts.collect::<Result<Vec<_>, _>>()?);
            rest = after;
        }
        name += rest;
        let is_fixed = |subscript: &Subscript| matches!(subscript, Subscript::Fixed(_));
        if groups.iter().flatten().all(is_fixed) {
            // The name of an element.
            return Ok(vec![Self::whole(text)]);
        }
        let mut found = Vec::new();
        if let [.., start] = starts[1..] {
            let last = groups.last().cloned().unwrap_or_default();
            found.push(Self { name: format!("{}{rest}", &text[..start]).into(), text, subscripts: last });
        }
        found.push(Self { name: name.into(), text, subscripts: groups.concat() });
        Ok(found)
    }

    /// Whether elements of an array read different variables.
    pub(crate) fn is_of_elements(&self) -> bool {
        !self.subscripts.is_empty()
    }

    /// What each element of a reader reads in an array with given positions and sizes. Subscripts outside the array are
    /// ignored.
    pub(crate) fn elements<'n>(
        &self,
        of: Reader<'_>,
        positions: &'n [usize],
        sizes: &[usize],
    ) -> Result<Found<'n>, String> {
        if !self.is_of_elements() {
            return Ok(Found::Alike(positions));
        }
        let Self { text, name, subscripts } = self;
        if sizes.is_empty() {
            return Err(format!("reads '{text}', but '{name}' is not an array"));
        }
        if subscripts.len() != sizes.len() {
            return Err(format!("reads '{text}', but '{name}' has {} subscripts", sizes.len()));
        }
        for (subscript, &size) in subscripts.iter().zip(sizes) {
            match subscript {
                Subscript::Own { dimension, .. } if *dimension >= of.components.len() + of.sizes.len() => {
                    let (letter, dimensions) = (letter(*dimension), dimension + 1);
                    return Err(format!(
                        "reads '{text}', but only arrays of {dimensions} dimensions have a subscript {letter}"
                    ));
                }
                Subscript::Fixed(number) if !(1..=size).contains(number) => {
                    return Err(format!("reads '{text}', but '{name}' has no element {number}"));
                }
                _ => {}
            }
        }
        let count = of.sizes.iter().product();
        let each: Vec<Vec<usize>> = (0..count)
            .map(|element| {
                let own = [of.components, &indices(element, of.sizes)].concat();
                let flat = subscripts.iter().zip(sizes).fold(vec![0], |flat, (subscript, &size)| {
                    let range = subscript.range(&own, size);
                    flat.into_iter()
                        .flat_map(|row| range.clone().map(move |index| row * size + index))
                        .collect()
                });
                flat.into_iter().map(|index| positions[index]).collect()
            })
            .collect();
        // A component may be the first or last of its array.
        if of.components.is_empty() && each.iter().all(Vec::is_empty) {
            return Err(format!("reads '{text}', but '{name}' has no such element"));
        }
        Ok(Found::Each(each))
    }
}

impl Subscript {
    fn new(text: &str) -> Result<Self, String> {
        if text == ":" {
            return Ok(Self::All);
        }
        let number = text.parse().map(Self::Fixed);
        let own = || {
            let (letter, offset) = text.split_at_checked(1)?;
            let dimension = usize::from(letter.as_bytes()[0].checked_sub(FIRST_LETTER)?);
            let offset = offset.trim().replace(' ', "");
            let offset = match offset.as_bytes().first() {
                None => Some(0),
                Some(b'+' | b'-') => offset.parse().ok(),
                _ => None,
            };
            Some(Self::Own {
                dimension: Some(dimension).filter(|dimension| *dimension < LETTERS)?,
                offset: offset?,
            })
        };
        number.ok().or_else(own).ok_or_else(|| {
            format!(
                "'{text}' is not a subscript: i, i-1 or i+1 (i, j, … are those of the element that reads), a number, or : for all"
            )
        })
    }

    /// The indices from 0 that the subscript means in a dimension of a size, for an element with its own indices.
    fn range(&self, own: &[usize], size: usize) -> Range<usize> {
        match self {
            Self::All => 0..size,
            Self::Fixed(number) => number - 1..*number,
            Self::Own { dimension, offset } => match own[*dimension].checked_add_signed(*offset) {
                Some(index) if index < size => index..index + 1,
                _ => 0..0,
            },
        }
    }
}

fn letter(dimension: usize) -> char {
    ('i'..).nth(dimension).unwrap_or_default()
}

/// An element's indices, from 0, in an array with some sizes.
fn indices(element: usize, sizes: &[usize]) -> Vec<usize> {
    let mut rest = element;
    let mut indices: Vec<_> = sizes
        .iter()
        .rev()
        .map(|size| {
            let index = rest % size;
            rest /= size;
            index
        })
        .collect();
    indices.reverse();
    indices
}
