//! The verbs of the skill, as services and over HTTP.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

use ros2_client::parameters::raw::{Parameter, ParameterValue};
use ros2_client::rcl_interfaces::{SetParametersRequest, SetParametersResponse};
use ros2_client::{Client, Message, ServiceMapping, ServiceTypeName};
use serde::{Deserialize, Serialize};
use tagalong::log::msgs::{Header, Twist};
use tagalong_ros2::{CommandType, Options};
use tagalong_sim::Simulation;

use crate::peers::*;

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct TriggerRequest {
    pub(crate) byte: u8,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct TriggerResponse {
    success: bool,
    message: String,
}

impl Message for TriggerRequest {}
impl Message for TriggerResponse {}

/// `nav2_msgs/SpeedLimit`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SpeedLimit {
    header: Header,
    percentage: bool,
    speed_limit: f64,
}

impl SpeedLimit {
    /// A limit of this speed, m/s.
    pub(crate) fn of(speed_limit: f64) -> Self {
        Self { header: Header::default(), percentage: false, speed_limit }
    }
}

pub(crate) fn client<Q, A>(
    peer: &mut Peer,
    service: &str,
    package: &str,
    kind: &str,
) -> Client<Q, A>
where
    Q: Message + Clone + 'static,
    A: Message + Clone + 'static,
{
    let kind = ServiceTypeName::new(package, kind);
    let mapping = ServiceMapping::Enhanced;
    peer.node.create_client(mapping, &name(service), &kind, reliable(), reliable()).unwrap()
}

/// Calls a service, again until it answers: the first request may come before the two know each other.
pub(crate) fn call<Q, A>(client: &Client<Q, A>, request: &Q) -> A
where
    Q: Message + Clone + 'static,
    A: Message + Clone + 'static,
{
    let from = Instant::now();
    while from.elapsed() < Duration::from_secs(15) {
        if let Some(answer) = call_once(client, request, Duration::from_secs(3)) {
            return answer;
        }
    }
    panic!("the service does not answer");
}

/// Calls a service that knows this caller; returns its answer if one comes in time.
pub(crate) fn call_once<Q, A>(client: &Client<Q, A>, request: &Q, patience: Duration) -> Option<A>
where
    Q: Message + Clone + 'static,
    A: Message + Clone + 'static,
{
    let id = client.send_request(request.clone()).unwrap();
    let sent = Instant::now();
    while sent.elapsed() < patience {
        match client.receive_response() {
            Ok(Some((answered, answer))) if answered == id => return Some(answer),
            _ => sleep(Duration::from_millis(10)),
        }
    }
    None
}

/// Returns status code and body of a request with JSON.
pub(crate) fn http(address: &str, method: &str, path: &str, body: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(address).unwrap();
    write!(
        stream,
        "{method} /{path} HTTP/1.1\r\nHost: {address}\r\nContent-Type: application/json\r\n\
         Content-Length: {}\r\n\r\n{body}",
        body.len()
    )
    .unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    let code = text.split(' ').nth(1).unwrap().parse().unwrap();
    (code, text.split_once("\r\n\r\n").unwrap().1.to_owned())
}

fn track(number: i64) -> SetParametersRequest {
    let value = ParameterValue {
        ptype: 2,
        boolean_value: false,
        int_value: number,
        double_value: 0.0,
        string_value: String::new(),
        byte_array: Vec::new(),
        bool_array: Vec::new(),
        int_array: Vec::new(),
        double_array: Vec::new(),
        string_array: Vec::new(),
    };
    SetParametersRequest { parameter: vec![Parameter { name: "track".into(), value }] }
}

/// Callers clear, enroll and limit the speed; commands are of the type of Humble.
#[test]
#[ignore = "waits for messages for a minute"]
fn a_person_is_enrolled_and_cleared_by_services_and_over_http() {
    let Some(_alone) = alone() else { return };
    let stop = Arc::new(AtomicBool::new(false));
    let heard_all = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::new(&scene(60.0), 1);
    let mut robot = Robot::new(domain(7), simulation.camera());
    let plain = "geometry_msgs/msg/Twist";
    let commands = robot.peer.collect_of::<Twist>("/cmd_vel", plain, &heard_all);
    let address = format!("127.0.0.1:{}", 20_000 + std::process::id() % 20_000);
    let options = Options {
        http: Some(address.parse().unwrap()),
        command_type: CommandType::Twist,
        ..options(domain(7), "20")
    };
    let registry = tagalong::builtin_registry();
    let (bridge, said) = bridge_with(options, registry, &stop);
    wait_for(&said, "answers at http://127.0.0.1:");
    assert_eq!(http(&address, "GET", "healthz", "").0, 503, "no frame yet");
    assert_eq!(http(&address, "POST", "clear", "{}").0, 503, "topics are waited for");
    let hand = Hand::new(domain(7), &stop);
    let mut caller = Peer::join(domain(7), "caller");
    let trigger = TriggerRequest { byte: 0 };
    let triggers = ["/people/status", "/people/clear", "/people/enroll_nearest"];
    let [status, clear, nearest] = triggers.map(|service| {
        client::<TriggerRequest, TriggerResponse>(&mut caller, service, "std_srvs", "Trigger")
    });
    let enroll = client::<SetParametersRequest, SetParametersResponse>(
        &mut caller,
        "/people/enroll",
        "rcl_interfaces",
        "SetParameters",
    );
    let limits = "nav2_msgs/msg/SpeedLimit";
    let limit = caller.publisher_of::<SpeedLimit>("/speed_limit", limits, reliable());
    let playing = thread::spawn(move || (robot.play(simulation), robot).1);
    hand.let_go(&said);
    commands.wait_for_move("the nearest person is followed by the config");
    assert_eq!(http(&address, "GET", "healthz", "").0, 200);

    let found = call(&status, &trigger);
    assert!(found.success && found.message.contains("\"people\":[{\"track\":"), "{found:?}");
    let refused = call(&enroll, &track(4711)).results.remove(0);
    assert!(!refused.successful && refused.reason.contains("no track 4711"), "{refused:?}");
    assert!(call(&clear, &trigger).success);
    // The robot slows down within its limits.
    sleep(Duration::from_millis(2000));
    let cleared = Instant::now();
    sleep(Duration::from_millis(700));
    assert!(!commands.moves_since(cleared), "cleared");
    assert!(!call(&status, &trigger).success, "no person is followed");
    assert!(call(&nearest, &trigger).success);
    commands.wait_for_move("the nearest person is followed by a call");
    assert_eq!(http(&address, "POST", "clear", "{}"), (200, "{\"ok\":true}".into()));
    let text = http(&address, "GET", "status", "").1;
    let number = text.split("\"people\":[{\"track\":").nth(1).unwrap();
    let number = number.split(',').next().unwrap();
    let body = format!("{{\"person\": {{\"track\": {number}}}}}");
    assert_eq!(http(&address, "POST", "enroll", &body).0, 200, "{body}");
    commands.wait_for_move("the person of a track is followed");

    limit.publish(SpeedLimit::of(0.05)).unwrap();
    wait_for(&said, "speed limit: 0.05 m/s");
    sleep(Duration::from_millis(2000));
    let limited = Instant::now();
    sleep(Duration::from_millis(700));
    let fastest = commands.so_far().into_iter().filter(|(at, _)| *at > limited);
    let fastest = fastest.map(|(_, command)| command.linear.x).fold(0.0, f64::max);
    assert!(fastest <= 0.05 + 1e-9, "{fastest}");

    stop.store(true, Ordering::Relaxed);
    bridge.join().unwrap().unwrap();
    heard_all.store(true, Ordering::Relaxed);
    drop(playing.join().unwrap());
}
