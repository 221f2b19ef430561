//! The conversion of an FMU's values to the interface, and whether it is plausible.

use fmu_io::terminal::number;
use fmu_package::connection::Conversion;
use fmu_package::{FmuDescription, FmuVariable, Function, Kind, Linear, unit_conversion};

use crate::Port;

/// Values that differ by this factor are probably in different units.
const SUSPICIOUS_FACTOR: f64 = 10.0;

/// A variable's conversion from or to the interface, in the direction of the signal, and whether a unit or a connection
/// gives it.
pub fn converted(
    port: &Port<'_>,
    fmu: &FmuDescription,
    variable: &FmuVariable,
    conversion: &Conversion,
) -> Result<(Function, bool), String> {
    let ((own, interface), is_input) = match (conversion, port.kind) {
        (Conversion::Function(function), _) => return Ok((function.clone(), true)),
        (Conversion::Units { from, to }, Kind::Input) => ((to, from), true),
        (Conversion::Units { from, to }, Kind::Output) => ((from, to), false),
    };
    let own = own.as_ref().unwrap_or(&variable.unit);
    if own.is_empty() {
        return Ok((Function::IDENTITY, false));
    }
    let wanted = port.unit();
    let interface = (interface.as_ref().unwrap_or(&wanted.name).as_str(), std::slice::from_ref(&wanted));
    let own = (own.as_str(), fmu.units.as_slice());
    let (from, to) = if is_input { (interface, own) } else { (own, interface) };
    unit_conversion(from, to).map(|conversion| (conversion.into(), true))
}

/// How a port's values follow from a variable's, as text.
pub fn relation(port: &Port<'_>, to_interface: &Function, variable: &str) -> String {
    match to_interface {
        Function::Linear(linear) => format!("{} = {}", port.name(), formula(*linear, variable)),
        Function::Table(entries) => {
            let entries = entries.iter().map(|(from, to)| format!("{} for {}", number(*to), number(*from)));
            format!("{} = {}", port.name(), entries.collect::<Vec<_>>().join(", "))
        }
    }
}

/// A linear function as text.
fn formula(Linear { factor, offset }: Linear, variable: &str) -> String {
    let product = format!("{} · {variable}", number(factor));
    match offset {
        0.0 => product,
        offset if offset < 0.0 => format!("{product} - {}", number(-offset)),
        offset => format!("{product} + {}", number(offset)),
    }
}

/// A note if the range or start value is implausible compared with the interface's; an error if one is not a number.
pub fn mismatch(
    port: &Port<'_>,
    variable: &FmuVariable,
    to_interface: &Function,
    is_certain: bool,
) -> Result<Option<String>, String> {
    let unit = &port.unit().name;
    // What a table leaves unchanged has no bounds to compare.
    let Function::Linear(to_interface) = to_interface else { return Ok(None) };
    let (min, max) = variable.range().map_err(|error| error.to_string())?;
    let (min, max) = (to_interface.apply(min), to_interface.apply(max));
    let own = (min.min(max), min.max(max));
    let wanted = expected(port, |ours| ours.range().ok().filter(|&range| is_bounded(range)));
    // An input's range must contain the range of the output connected to it.
    if let Some(wanted) = wanted.filter(|_| is_bounded(own)) {
        let (taker, giver) = match port.kind {
            Kind::Input => (own, wanted),
            Kind::Output => (wanted, own),
        };
        // Undeclared bounds are not compared.
        let is_below = giver.0.is_finite() && giver.0 < taker.0;
        let is_above = giver.1.is_finite() && giver.1 > taker.1;
        if is_below || is_above {
            let [own, wanted] =
                [own, wanted].map(|(min, max)| format!("{}..{} {unit}", number(min), number(max)));
            return Ok(Some(format!("its range is {own}, the interface's {wanted}")));
        }
    }
    let start =
        |variable: &FmuVariable| variable.start.trim().parse::<f64>().ok().filter(|start| *start != 0.0);
    if !is_certain
        && let (Some(own), Some(wanted)) = (start(variable), expected(port, start))
        && !(SUSPICIOUS_FACTOR.recip()..=SUSPICIOUS_FACTOR).contains(&(own / wanted))
    {
        let [own, wanted] = [own, wanted].map(number);
        return Ok(Some(format!("its start value is {own}, the interface's {wanted} {unit}")));
    }
    Ok(None)
}

/// Our FMUs' declarations of a port; that of the other role comes first.
fn expected<T>(port: &Port<'_>, declared: impl Fn(&FmuVariable) -> Option<T>) -> Option<T> {
    port.counterpart.and_then(&declared).or_else(|| declared(port.variable))
}

fn is_bounded((min, max): (f64, f64)) -> bool {
    min.is_finite() || max.is_finite()
}
