//! The stand as holding registers, as in the example of docs/how-to/rig.md: readings from 0 and setpoints from 100 as singles of two registers,
//! air 110, heartbeat 111, tripped 112, acknowledge 113. As a device of its own it answers as unit 255 or 0 (Modbus Messaging on TCP/IP 1.0b,
//! 4.4.1.2). Other units do not exist behind it; it reports that as a gateway does.

use crate::stand::{SETPOINTS as SETPOINTS_IN_ORDER, Stand, Target, measured};
use std::future::{Ready, ready};
use std::sync::{Arc, Mutex};
use tokio::net::TcpListener;
use tokio_modbus::prelude::{ExceptionCode, Request, Response, SlaveRequest};
use tokio_modbus::server::Service;
use tokio_modbus::server::tcp::{Server, accept_tcp_connection};

const SETPOINTS: u16 = 100;
const AIR: u16 = 110;
const HEARTBEAT: u16 = 111;
const TRIPPED: u16 = 112;
const ACKNOWLEDGE: u16 = 113;
const END: u16 = 200;
/// Unit numbers of the stand.
pub const UNITS: [u8; 2] = [255, 0];

#[derive(Clone)]
struct Registers(Arc<Mutex<Stand>>);

fn to_registers(value: f64) -> [u16; 2] {
    let bits = (value as f32).to_bits();
    [(bits >> 16) as u16, bits as u16]
}

impl Registers {
    fn register(stand: &Stand, at: u16) -> u16 {
        let pair = |value: f64, at: u16| to_registers(value)[usize::from(at % 2)];
        match at {
            AIR => stand.commanded(Target::Air) as u16,
            HEARTBEAT => stand.commanded(Target::Heartbeat) as u16,
            TRIPPED => u16::from(stand.tripped().is_some()),
            SETPOINTS..AIR => {
                let target = SETPOINTS_IN_ORDER.get(usize::from(at - SETPOINTS) / 2);
                target.map_or(0, |target| pair(stand.commanded(*target), at))
            }
            _ => {
                let channel = measured().get(usize::from(at) / 2).copied();
                channel.map_or(0, |channel| pair(stand.reading(channel).unwrap_or(f64::NAN), at))
            }
        }
    }

    fn read(&self, start: u16, count: u16) -> Result<Vec<u16>, ExceptionCode> {
        let end = start.checked_add(count).filter(|end| *end <= END);
        let end = end.ok_or(ExceptionCode::IllegalDataAddress)?;
        let stand = self.0.lock().map_err(|_| ExceptionCode::ServerDeviceFailure)?;
        Ok((start..end).map(|at| Self::register(&stand, at)).collect())
    }

    fn write(&self, start: u16, values: &[u16]) -> Result<(), ExceptionCode> {
        let mut stand = self.0.lock().map_err(|_| ExceptionCode::ServerDeviceFailure)?;
        let (mut at, mut rest) = (start, values);
        while let [first, more @ ..] = rest {
            let (target, value, used) = match at {
                AIR => (Target::Air, f64::from(*first), 1),
                HEARTBEAT => (Target::Heartbeat, f64::from(*first), 1),
                ACKNOWLEDGE => (Target::Acknowledge, f64::from(*first), 1),
                SETPOINTS..AIR if at % 2 == 0 => {
                    let target = SETPOINTS_IN_ORDER.get(usize::from(at - SETPOINTS) / 2);
                    let (target, second) =
                        target.zip(more.first()).ok_or(ExceptionCode::IllegalDataAddress)?;
                    let bits = u32::from(*first) << 16 | u32::from(*second);
                    (*target, f64::from(f32::from_bits(bits)), 2)
                }
                _ => return Err(ExceptionCode::IllegalDataAddress),
            };
            stand.write(target, value).map_err(|_| ExceptionCode::IllegalDataValue)?;
            (at, rest) = (at + used, rest.get(usize::from(used)..).unwrap_or_default());
        }
        Ok(())
    }
}

impl Service for Registers {
    type Request = SlaveRequest<'static>;
    type Response = Response;
    type Exception = ExceptionCode;
    type Future = Ready<Result<Response, ExceptionCode>>;

    fn call(&self, request: SlaveRequest<'static>) -> Self::Future {
        if !UNITS.contains(&request.slave) {
            return ready(Err(ExceptionCode::GatewayTargetDevice));
        }
        ready(match request.request {
            Request::ReadHoldingRegisters(start, count) => {
                self.read(start, count).map(Response::ReadHoldingRegisters)
            }
            Request::ReadInputRegisters(start, count) => {
                self.read(start, count).map(Response::ReadInputRegisters)
            }
            Request::WriteSingleRegister(at, value) => {
                self.write(at, &[value]).map(|()| Response::WriteSingleRegister(at, value))
            }
            Request::WriteMultipleRegisters(start, values) => {
                let count = values.len() as u16;
                self.write(start, &values).map(|()| Response::WriteMultipleRegisters(start, count))
            }
            _ => Err(ExceptionCode::IllegalFunction),
        })
    }
}

pub async fn serve(listener: TcpListener, stand: Arc<Mutex<Stand>>) -> std::io::Result<()> {
    let server = Server::new(listener);
    let registers = |_| Ok(Some(Registers(stand.clone())));
    let connected = |stream, address| async move { accept_tcp_connection(stream, address, registers) };
    server.serve(&connected, |_| {}).await
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 123456.0 as a single is 0x47F12000 (IEEE 754), with the high word first.
    #[test]
    fn a_single_is_two_registers() {
        assert_eq!(to_registers(123_456.0), [0x47f1, 0x2000]);
    }
}
