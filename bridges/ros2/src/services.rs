//! The requests of callers as ROS 2 services of standard types.

use futures::StreamExt;
use futures::executor::block_on;
use futures::future::{AbortHandle, Abortable, ready};
use ros2_client::parameters::raw::{Parameter, ParameterType, ParameterValue, SetParametersResult};
use ros2_client::rcl_interfaces::{SetParametersRequest, SetParametersResponse};
use ros2_client::{Message, Server, ServiceMapping};
use serde::{Deserialize, Serialize};
use tagalong::core::TrackId;
use tagalong::pipeline::{Choice, Enrollment};

use crate::network::{Ear, Network};
use crate::skill::{Desk, Refusal, Verb};
use crate::{BridgeError, threads};

/// Middleware of the ROS 2 nodes that call the services, because each transmits the sequence number
/// of a request in its own way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Middleware {
    /// Fast DDS, which is the default of ROS 2.
    #[default]
    #[value(name = "rmw_fastrtps_cpp", alias = "rmw_fastrtps_dynamic_cpp")]
    FastDds,
    /// Cyclone DDS.
    #[value(name = "rmw_cyclonedds_cpp")]
    CycloneDds,
}

impl Middleware {
    pub(crate) fn mapping(self) -> ServiceMapping {
        match self {
            Self::FastDds => ServiceMapping::Enhanced,
            Self::CycloneDds => ServiceMapping::Cyclone,
        }
    }
}

/// Request of `std_srvs/Trigger`, which is one byte in DDS.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct TriggerRequest {
    structure_needs_at_least_one_member: u8,
}

/// Answer of `std_srvs/Trigger`.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct TriggerResponse {
    success: bool,
    message: String,
}

impl Message for TriggerRequest {}
impl Message for TriggerResponse {}

impl From<Result<(), Refusal>> for TriggerResponse {
    fn from(answer: Result<(), Refusal>) -> Self {
        let message = answer.as_ref().err().map(|refusal| refusal.reason().to_owned());
        Self { success: answer.is_ok(), message: message.unwrap_or_default() }
    }
}

/// Offers the services: `people/enroll` (`rcl_interfaces/SetParameters`), and `people/enroll_nearest`,
/// `people/enroll_approach`, `people/clear` and `people/status` (`std_srvs/Trigger`).
///
/// # Errors
/// [`BridgeError::Network`] and [`BridgeError::Thread`].
pub(crate) fn offer(
    network: &mut Network,
    middleware: Middleware,
    desk: &Desk,
) -> Result<Vec<Ear>, BridgeError> {
    let mapping = middleware.mapping();
    let mut all = Vec::new();
    let verbs = [
        ("people/enroll_nearest", Verb::Enroll(Enrollment::of(Choice::Nearest))),
        ("people/enroll_approach", Verb::Enroll(Enrollment::of(Choice::Approach))),
        ("people/enroll_raised_hand", Verb::Enroll(Enrollment::of(Choice::RaisedHand))),
        ("people/clear", Verb::Clear),
    ];
    for (name, verb) in verbs {
        let server = network.server(name, "std_srvs/srv/Trigger", mapping)?;
        let desk = desk.clone();
        all.push(serve(name, server, move |_: TriggerRequest| {
            TriggerResponse::from(desk.ask(verb))
        })?);
    }
    let name = "people/status";
    let server = network.server(name, "std_srvs/srv/Trigger", mapping)?;
    let theirs = desk.clone();
    all.push(serve(name, server, move |_: TriggerRequest| status(&theirs))?);
    let name = "people/enroll";
    let server = network.server(name, "rcl_interfaces/srv/SetParameters", mapping)?;
    let desk = desk.clone();
    all.push(serve(name, server, move |request| enroll(&desk, &request))?);
    Ok(all)
}

/// Answers the requests of a service in a separate thread.
pub(crate) fn serve<Q, A>(
    name: &str,
    server: Server<Q, A>,
    answer: impl Fn(Q) -> A + Send + 'static,
) -> Result<Ear, BridgeError>
where
    Q: Message + Clone + Send + 'static,
    A: Message + Send + 'static,
{
    let (abort, registration) = AbortHandle::new_pair();
    let thread = threads::start("a service", move || {
        let served = server.receive_request_stream().for_each(|request| {
            // A request that cannot be decoded has no sequence number to answer.
            if let Ok((id, request)) = request {
                let _lost = server.send_response(id, answer(request));
            }
            ready(())
        });
        // The stream ends when it is aborted.
        let _aborted = block_on(Abortable::new(served, registration));
    })?;
    Ok(Ear::new(name, abort, thread))
}

/// Returns the status as JSON; success means that a person is followed.
fn status(desk: &Desk) -> TriggerResponse {
    let status = desk.status();
    let success = status.follow.as_ref().is_some_and(|follow| follow.follows);
    match serde_json::to_string(&status) {
        Ok(message) => TriggerResponse { success, message },
        Err(error) => TriggerResponse { success: false, message: error.to_string() },
    }
}

/// Enrolls according to the parameters; the result is the same for each of them.
fn enroll(desk: &Desk, request: &SetParametersRequest) -> SetParametersResponse {
    let answer = match enrollment(&request.parameter) {
        Ok(enrollment) => desk.ask(Verb::Enroll(enrollment)),
        Err(reason) => Err(Refusal::Refused(reason)),
    };
    let reason = answer.as_ref().err().map_or("", Refusal::reason).to_owned();
    let result = SetParametersResult { successful: answer.is_ok(), reason };
    SetParametersResponse { results: vec![result; request.parameter.len().max(1)] }
}

/// Parses `person` ("nearest", "approach" or "raised-hand"), `track` or `point`, and the patience.
fn enrollment(parameters: &[Parameter]) -> Result<Enrollment, String> {
    let mut person = None;
    let mut patience = Enrollment::of(Choice::Nearest);
    for Parameter { name, value } in parameters {
        let choice = match name.as_str() {
            "person" => {
                let choice = named(value);
                Some(choice.ok_or_else(|| wrong_value(name, "\"nearest\" or \"approach\""))?)
            }
            "track" => {
                let number = number(value).and_then(whole);
                let number = number.ok_or_else(|| wrong_value(name, "the number of a track"))?;
                Some(Choice::Track(TrackId(number)))
            }
            "point" => {
                let point = point(value).ok_or_else(|| wrong_value(name, "two numbers"))?;
                Some(Choice::Point(point))
            }
            "lose_after_s" => {
                let number = number(value).ok_or_else(|| wrong_value(name, "a number"))?;
                patience.lose_after_s = Some(number);
                None
            }
            "give_up_s" => {
                let number = number(value).ok_or_else(|| wrong_value(name, "a number"))?;
                patience.give_up_s = Some(number);
                None
            }
            "search" if value.ptype == ParameterType::BOOL => {
                patience.search = Some(value.boolean_value);
                None
            }
            "search" => return Err(wrong_value(name, "true or false")),
            _ => {
                let known = "person, track, point, lose_after_s, search, give_up_s";
                return Err(format!("unknown `{name}`; there are {known}"));
            }
        };
        if choice.is_some() && person.is_some() {
            return Err("give one of `person`, `track` and `point`".to_owned());
        }
        person = person.or(choice);
    }
    let person = person.ok_or("give `person`, `track` or `point`")?;
    Ok(Enrollment { person, ..patience })
}

/// Returns the rejection of a parameter whose value has another type.
fn wrong_value(name: &str, wanted: &str) -> String {
    format!("`{name}` must be {wanted}")
}

fn named(value: &ParameterValue) -> Option<Choice> {
    match (value.ptype, value.string_value.as_str()) {
        (ParameterType::STRING, "nearest") => Some(Choice::Nearest),
        (ParameterType::STRING, "approach") => Some(Choice::Approach),
        (ParameterType::STRING, "raised-hand") => Some(Choice::RaisedHand),
        _ => None,
    }
}

fn number(value: &ParameterValue) -> Option<f64> {
    match value.ptype {
        ParameterType::INTEGER => Some(value.int_value as f64),
        ParameterType::DOUBLE => Some(value.double_value),
        _ => None,
    }
}

fn whole(number: f64) -> Option<u32> {
    let is_whole = number.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&number);
    is_whole.then_some(number as u32)
}

fn point(value: &ParameterValue) -> Option<[f64; 2]> {
    match value.ptype {
        ParameterType::DOUBLE_ARRAY => value.double_array[..].try_into().ok(),
        ParameterType::INTEGER_ARRAY => {
            let [x, y]: [i64; 2] = value.int_array[..].try_into().ok()?;
            Some([x as f64, y as f64])
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(name: &str, ptype: u8, set: impl FnOnce(&mut ParameterValue)) -> Parameter {
        let mut value = ParameterValue {
            ptype,
            boolean_value: false,
            int_value: 0,
            double_value: 0.0,
            string_value: String::new(),
            byte_array: Vec::new(),
            bool_array: Vec::new(),
            int_array: Vec::new(),
            double_array: Vec::new(),
            string_array: Vec::new(),
        };
        set(&mut value);
        Parameter { name: name.into(), value }
    }

    #[test]
    fn parameters_are_an_enrollment() {
        let nearest = parameter("person", 4, |value| value.string_value = "nearest".into());
        let track = parameter("track", 2, |value| value.int_value = 3);
        let point = parameter("point", 8, |value| value.double_array = vec![320.0, 240.5]);
        let pixels = parameter("point", 7, |value| value.int_array = vec![320, 240]);
        let search = parameter("search", 1, |value| value.boolean_value = true);
        let patience = parameter("lose_after_s", 3, |value| value.double_value = 3.5);
        let give_up = parameter("give_up_s", 2, |value| value.int_value = 30);
        let by_default = enrollment(std::slice::from_ref(&nearest));
        assert_eq!(by_default.unwrap(), Enrollment::of(Choice::Nearest));
        assert_eq!(enrollment(&[point]).unwrap().person, Choice::Point([320.0, 240.5]));
        assert_eq!(enrollment(&[pixels]).unwrap().person, Choice::Point([320.0, 240.0]));
        let all = enrollment(&[search, patience, track.clone(), give_up.clone()]).unwrap();
        assert_eq!(all.person, Choice::Track(TrackId(3)));
        assert_eq!((all.search, all.lose_after_s), (Some(true), Some(3.5)));
        assert_eq!(all.give_up_s, Some(30.0));
        assert!(enrollment(&[nearest, track]).unwrap_err().contains("give one of"));
        assert!(enrollment(&[give_up]).unwrap_err().contains("give `person`"));
    }

    #[test]
    fn a_parameter_of_another_kind_is_refused_by_name() {
        for wrong in [
            parameter("person", 4, |value| value.string_value = "me".into()),
            parameter("track", 3, |value| value.double_value = 1.5),
            parameter("track", 2, |value| value.int_value = -1),
            parameter("point", 8, |value| value.double_array = vec![1.0]),
            parameter("search", 4, |value| value.string_value = "true".into()),
            parameter("lose_after_s", 4, |value| value.string_value = "3".into()),
            parameter("speed", 3, |value| value.double_value = 9.0),
        ] {
            let refusal = enrollment(std::slice::from_ref(&wrong)).unwrap_err();
            assert!(refusal.contains(&format!("`{}`", wrong.name)), "{refusal}");
        }
    }
}
