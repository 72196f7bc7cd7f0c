//! What is done with a drive over its service channel, element by element.

use super::file::{Entry, Origin};
use super::value::Readable;
use anyhow::{Context, Result};
use ring::ident::{self, Element, Value};
use ring::service_client::{Finished, Reply, Request, ServiceError, Step, meaning};
use sercos::Idn;
use sercos::attribute::Attribute;

/// Finding of the last write or command, in words.
const FINDING: Idn = Idn::product(3);
/// Data blocks that a control saves and restores.
const BACKUP_LIST: Idn = Idn::standard(192);
const MANUFACTURER_VERSION: Idn = Idn::standard(30);
const CONTROLLER_TYPE: Idn = Idn::standard(140);
const APPLICATION_TYPE: Idn = Idn::standard(142);
const CHECKSUM: Idn = Idn::standard(326);

/// How often the data status of a command is asked for: two minutes of the slowest master.
const POLLS: u32 = 20_000;

/// The run was possible and came to nothing: exit code 1, where an error of the command line or of a file is 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Failed(pub(crate) String);

/// A drive in CP2, the phase in which everything of S-0-0192 may be written.
pub(crate) trait Link {
    /// Takes a request to its end, with the drive's refusal in its result.
    ///
    /// # Errors
    /// The ring, or what the drive runs on, does not go on.
    fn ask(&mut self, request: Request) -> Result<Finished>;

    /// Time of the ring in microseconds, for those who show how far it is.
    fn time_us(&self) -> u64;
}

/// What the drive does not do, with its error code and, where it has one, its finding in words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Refusal {
    code: Option<u16>,
    finding: String,
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.code {
            Some(code) => write!(formatter, "the drive refuses with {code:04X}H, {}", meaning(code))?,
            None => write!(formatter, "the drive ends it with an error")?,
        }
        if self.finding.is_empty() { Ok(()) } else { write!(formatter, ": {}", self.finding) }
    }
}

/// A data block as the drive describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Described {
    pub(crate) idn: Idn,
    pub(crate) attribute: Attribute,
    /// Empty where it was not asked for.
    pub(crate) name: String,
    /// Empty where there is none.
    pub(crate) unit: String,
    pub(crate) value: Value,
}

impl Described {
    /// As it stands in a file.
    pub(crate) fn entry(&self) -> Result<Entry> {
        let value = Readable::of(&self.value, self.attribute);
        let value = value.map_err(|cause| Failed(format!("{} \"{}\": {cause}", self.idn, self.name)))?;
        Ok(Entry { name: self.name.clone(), unit: self.unit.clone(), value })
    }
}

/// A drive at the end of a link.
pub(crate) struct Drive<L> {
    link: L,
}

impl<L: Link> Drive<L> {
    pub(crate) const fn new(link: L) -> Self {
        Self { link }
    }

    /// What it is reached by.
    pub(crate) const fn link(&self) -> &L {
        &self.link
    }

    #[cfg(test)]
    pub(crate) const fn link_mut(&mut self) -> &mut L {
        &mut self.link
    }

    /// S-0-0192, in ascending order.
    pub(crate) fn backup_list(&mut self) -> Result<Vec<Idn>> {
        let value = self.value(BACKUP_LIST)?;
        let list = value.as_idns().context(Failed(format!("{BACKUP_LIST} is no list of IDNs")))?;
        let mut idns: Vec<Idn> = list.into_iter().map(|idn| Idn(idn.0)).collect();
        idns.sort();
        idns.dedup();
        Ok(idns)
    }

    /// What the drive says about itself.
    pub(crate) fn origin(&mut self) -> Result<Origin> {
        Ok(Origin {
            manufacturer_version: self.text(MANUFACTURER_VERSION)?,
            controller_type: self.text(CONTROLLER_TYPE)?,
            application_type: self.text(APPLICATION_TYPE)?,
            checksum: self.checksum()?,
        })
    }

    /// S-0-0326.
    pub(crate) fn checksum(&mut self) -> Result<String> {
        Ok(self.must_describe(CHECKSUM, false)?.entry()?.value.to_string())
    }

    /// A data block without its name, or with it; `None`: the drive does not have it.
    pub(crate) fn describe(&mut self, idn: Idn, with_name: bool) -> Result<Option<Described>> {
        let opened = self.steps(vec![
            Step::open(ident::Idn(idn.0)),
            read(Element::Attribute, false),
            read(Element::Attribute, true),
        ])?;
        let (low, high) = match opened {
            Ok(words) => (u32::from(words[1]), u32::from(words[2])),
            Err(0x1001) => {
                self.close()?;
                return Ok(None);
            }
            Err(code) => return Err(unreadable(idn, code)),
        };
        let attribute = Attribute::new_with_raw_value(high << 16 | low);
        let name = if with_name { self.text_of(Element::Name)?.unwrap_or_default() } else { String::new() };
        let unit = self.text_of(Element::Unit)?.unwrap_or_default();
        let value = self.data(attribute)?.map_err(|code| unreadable(idn, code))?;
        self.close()?;
        Ok(Some(Described { idn, attribute, name, unit, value }))
    }

    /// The same of a data block that every drive of this kind has.
    pub(crate) fn must_describe(&mut self, idn: Idn, with_name: bool) -> Result<Described> {
        let described = self.describe(idn, with_name)?;
        Ok(described.ok_or_else(|| Failed(format!("the drive has no {idn}")))?)
    }

    /// Operation data.
    pub(crate) fn value(&mut self, idn: Idn) -> Result<Value> {
        match self.link.ask(Request::Read(ident::Idn(idn.0)))?.result {
            Ok(Reply::Data { value, .. }) => Ok(value),
            Ok(reply) => Err(Failed(format!("{idn}: {reply:?} is no value")).into()),
            Err(ServiceError::Refused { code, .. }) => Err(unreadable(idn, code)),
            Err(error) => Err(Failed(error.to_string()).into()),
        }
    }

    /// Writes operation data.
    pub(crate) fn write(&mut self, idn: Idn, value: Value) -> Result<Result<(), Refusal>> {
        self.settle(Request::Write(ident::Idn(idn.0), value))
    }

    /// Executes a procedure command to its end.
    pub(crate) fn command(&mut self, idn: Idn) -> Result<Result<(), Refusal>> {
        self.settle(Request::Command { idn: ident::Idn(idn.0), polls: POLLS })
    }

    fn settle(&mut self, request: Request) -> Result<Result<(), Refusal>> {
        let code = match self.link.ask(request)?.result {
            Ok(_) => return Ok(Ok(())),
            Err(ServiceError::Refused { code, .. }) => Some(code),
            Err(ServiceError::CommandFailed { status, .. }) if status & 8 != 0 => None,
            Err(error) => return Err(Failed(error.to_string()).into()),
        };
        let finding = self.text(FINDING)?;
        Ok(Err(Refusal { code, finding }))
    }

    fn text(&mut self, idn: Idn) -> Result<String> {
        Ok(self.value(idn)?.as_text().unwrap_or_default())
    }

    /// Name or unit of the open data block; `None`: it has none.
    fn text_of(&mut self, element: Element) -> Result<Option<String>> {
        Ok(self.variable(element)?.ok().and_then(|value| value.as_text()))
    }

    /// Operation data of the open data block, or the error code.
    fn data(&mut self, attribute: Attribute) -> Result<Result<Value, u16>> {
        match attribute.length().fixed_bytes() {
            Some(bytes) => {
                let words = self.words(Element::Data, usize::from(bytes) / 2)?;
                Ok(words.map(|words| Value::of_words(&words, false)))
            }
            None => self.variable(Element::Data),
        }
    }

    fn variable(&mut self, element: Element) -> Result<Result<Value, u16>> {
        let length = match self.steps(vec![read(element, false)])? {
            Ok(words) => words[0],
            Err(code) => return Ok(Err(code)),
        };
        // Behind the length comes the greatest length, then the bytes.
        let rest = self.words(element, 1 + usize::from(length).div_ceil(2))?;
        Ok(rest.map(|rest| Value::of_words(&[vec![length], rest].concat(), true)))
    }

    fn words(&mut self, element: Element, number: usize) -> Result<Result<Vec<u16>, u16>> {
        self.steps((1..=number).map(|index| read(element, index == number)).collect())
    }

    fn close(&mut self) -> Result<()> {
        let closed = self.steps(vec![Step::close(0)])?;
        Ok(closed.map(|_| ()).map_err(|code| Failed(format!("the service channel does not close: {code:04X}H")))?)
    }

    /// The answers to these steps, or the first error code.
    fn steps(&mut self, steps: Vec<Step>) -> Result<Result<Vec<u16>, u16>> {
        let number = steps.len();
        let finished = self.link.ask(Request::Steps(steps))?;
        finished.result.map_err(|error| Failed(error.to_string()))?;
        anyhow::ensure!(finished.steps.len() == number, "{} of {number} steps were answered", finished.steps.len());
        let refused = finished.steps.iter().find(|step| step.error).map(|step| step.reply);
        Ok(refused.map_or_else(|| Ok(finished.steps.iter().map(|step| step.reply).collect()), Err))
    }
}

fn unreadable(idn: Idn, code: u16) -> anyhow::Error {
    Failed(format!("{idn} cannot be read: the drive refuses with {code:04X}H, {}", meaning(code))).into()
}

const fn read(element: Element, end: bool) -> Step {
    Step { element, write: false, end, info: 0 }
}
