//! The DDS node: discovery, subscriptions and publishers.

use std::sync::Arc;
use std::thread::JoinHandle;

use futures::StreamExt;
use futures::executor::block_on;
use futures::future::{AbortHandle, Abortable, ready};
use ros2_client::action::{ActionClient, ActionClientQosPolicies};
use ros2_client::dds::rustdds::{QosPolicies, RTPSEntity};
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{
    ActionTypeName, Context, ContextOptions, Gid, MessageInfo, MessageTypeName, Name, Node,
    NodeName, NodeOptions, Publisher, QosProfile, Server, ServiceMapping, ServiceTypeName,
    Subscription,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use tagalong::log::msgs::{
    CameraInfo, Detection2DArray, Detection3DArray, LaserScan, Message, Odometry, TFMessage, encode,
};

use crate::inbox::Inbox;
use crate::messages::{
    Bool, Empty, FrameMessage, IMAGES, OTHERS, OwnedCompressedImage, OwnedFfmpegPacket, OwnedImage,
    OwnedPointCloud, OwnedVideo, SpeedLimit, ros_topic, ros_type,
};
use crate::publishers::Origin;
use crate::raw::RawAdapter;
use crate::stamps::StampClock;
use crate::{BridgeError, threads};

/// Number of service answers that are kept for callers that missed them.
const ANSWERS: usize = 10;
/// Number of events that are kept for subscribers that missed them.
const EVENTS: usize = 16;

/// Types of the topics that every node has, including this one; they do not belong to a robot.
const OF_EVERY_NODE: [&str; 4] = [
    "builtin_interfaces/msg/Time",
    "lifecycle_msgs/msg/TransitionEvent",
    "rcl_interfaces/msg/ParameterEvent",
    "rosgraph_msgs/msg/Clock",
];

/// The node of the bridge.
pub(crate) struct Network {
    node: Node,
    context: Context,
    spinner: Option<JoinHandle<()>>,
}

/// A subscription that ends when it is dropped.
pub(crate) struct Ear {
    topic: String,
    abort: AbortHandle,
    thread: Option<JoinHandle<()>>,
}

impl Ear {
    pub(crate) fn new(topic: &str, abort: AbortHandle, thread: JoinHandle<()>) -> Self {
        Self { topic: topic.to_owned(), abort, thread: Some(thread) }
    }

    pub(crate) fn topic(&self) -> &str {
        &self.topic
    }
}

impl Drop for Ear {
    fn drop(&mut self) {
        self.abort.abort();
        self.thread.take().map(JoinHandle::join);
    }
}

fn failed(error: impl std::fmt::Debug) -> BridgeError {
    BridgeError::Network(format!("{error:?}"))
}

/// Returns the sensor profile: only the newest messages, best effort, which is compatible with all
/// publishers.
fn sensor(depth: usize) -> QosProfile {
    QosProfile::subscription_default()
        .reliability_best_effort()
        .history(History::KeepLast { depth })
}

/// Returns a profile that also receives messages that were sent before the subscription.
fn latched() -> QosProfile {
    sensor(OTHERS).reliability_reliable(WhenFull::DEFAULT).durability(Durability::TransientLocal)
}

/// Returns the profile of the topics that enable and stop the robot: all messages arrive, except
/// those that were sent before the subscription.
fn commands() -> QosProfile {
    sensor(OTHERS).reliability_reliable(WhenFull::DEFAULT)
}

/// Returns a profile in which all messages arrive, but publishing does not block.
fn reliable() -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::Fail)
        .history(History::KeepLast { depth: 1 })
}

impl Network {
    pub(crate) fn join(domain: u16, namespace: &str) -> Result<Self, BridgeError> {
        let context = Context::with_options(ContextOptions::new().domain_id(domain));
        let context = context.map_err(failed)?;
        let name = NodeName::new(namespace, "tagalong")
            .map_err(|error| BridgeError::Config(format!("namespace `{namespace}`: {error:?}")))?;
        let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
        let mut node = context.new_node(name, options).map_err(failed)?;
        let spinner = node.spinner().map_err(failed)?;
        // The thread ends when the node is dropped.
        let spinner = threads::start("the node", move || drop(block_on(spinner.spin())))?;
        Ok(Self { node, context, spinner: Some(spinner) })
    }

    /// Returns all discovered topics that may belong to a robot, with their message types.
    pub(crate) fn topics(&self) -> Vec<(String, String)> {
        let found = self.context.discovered_topics();
        let named = found.iter().filter_map(|topic| {
            Some((ros_topic(&topic.name)?.to_owned(), ros_type(&topic.type_name)?))
        });
        named.filter(|(_, kind)| !OF_EVERY_NODE.contains(&kind.as_str())).collect()
    }

    /// Puts the messages of a topic into the inbox; returns `None` for a type that is not used.
    pub(crate) fn listen(
        &mut self,
        topic: &str,
        message_type: &str,
        inbox: &Arc<Inbox>,
        clock: &Arc<StampClock>,
    ) -> Result<Option<Ear>, BridgeError> {
        let ear = match message_type {
            "sensor_msgs/msg/Image" => {
                self.frames::<OwnedImage>(topic, message_type, IMAGES, inbox, clock)
            }
            "sensor_msgs/msg/CompressedImage" => {
                self.frames::<OwnedCompressedImage>(topic, message_type, OTHERS, inbox, clock)
            }
            "foxglove_msgs/msg/CompressedVideo" => {
                self.frames::<OwnedVideo>(topic, message_type, OTHERS, inbox, clock)
            }
            "ffmpeg_image_transport_msgs/msg/FFMPEGPacket" => {
                self.frames::<OwnedFfmpegPacket>(topic, message_type, OTHERS, inbox, clock)
            }
            // As large as images.
            "sensor_msgs/msg/PointCloud2" => {
                self.frames::<OwnedPointCloud>(topic, message_type, IMAGES, inbox, clock)
            }
            CameraInfo::TYPE => self.plain::<CameraInfo>(topic, sensor(OTHERS), inbox),
            Odometry::TYPE => self.plain::<Odometry>(topic, sensor(OTHERS), inbox),
            LaserScan::TYPE => self.frames::<LaserScan>(topic, message_type, OTHERS, inbox, clock),
            // Static transforms are sent once, usually before the bridge joins the network.
            TFMessage::TYPE if topic.ends_with("tf_static") => {
                self.plain::<TFMessage>(topic, latched(), inbox)
            }
            TFMessage::TYPE => self.plain::<TFMessage>(topic, sensor(OTHERS), inbox),
            Detection2DArray::TYPE => self.plain::<Detection2DArray>(topic, sensor(OTHERS), inbox),
            Detection3DArray::TYPE => self.plain::<Detection3DArray>(topic, sensor(OTHERS), inbox),
            _ => return Ok(None),
        };
        ear.map(Some)
    }

    /// Puts the messages of a topic of any type into the inbox in serialised form: those of bumpers
    /// and range sensors, for which bases have their own types.
    pub(crate) fn listen_raw(
        &mut self,
        topic: &str,
        message_type: &str,
        inbox: &Arc<Inbox>,
    ) -> Result<Ear, BridgeError> {
        let qos = sensor(OTHERS);
        let full = name(self.node.namespace(), topic)?;
        let handle = self.node.create_topic(&full, kind(message_type), &qos).map_err(failed)?;
        let participant = self.context.domain_participant();
        let policies = QosPolicies::from(&qos);
        let subscriber = participant.create_subscriber(&policies).map_err(failed)?;
        let reader = subscriber
            .create_simple_datareader_no_key::<Vec<u8>, RawAdapter>(&handle, Some(policies))
            .map_err(failed)?;
        let (abort, registration) = AbortHandle::new_pair();
        let inbox = Arc::clone(inbox);
        let name = topic.to_owned();
        let thread = threads::start("a topic", move || {
            // The reader lives only as long as its subscriber.
            let _subscriber = subscriber;
            let put = reader.as_async_stream().for_each(|message| {
                match message {
                    Ok(message) => inbox.push(&name, message.into_value(), OTHERS),
                    Err(_) => inbox.count_malformed(&name),
                }
                ready(())
            });
            // The stream ends when it is aborted.
            let _aborted = block_on(Abortable::new(put, registration));
        })?;
        Ok(Ear::new(topic, abort, thread))
    }

    /// Calls `on` for each message of the enable topic, in a thread that waits for no frame: with
    /// the origin of a message that is true, and with `None` for one that is false or cannot be
    /// decoded.
    pub(crate) fn listen_to_enable(
        &mut self,
        topic: &str,
        inbox: &Arc<Inbox>,
        on: impl Fn(Option<Origin>) + Send + 'static,
    ) -> Result<Ear, BridgeError> {
        let inbox = Arc::clone(inbox);
        let name = topic.to_owned();
        self.hear(topic, "std_msgs/msg/Bool", commands(), move |message: Option<(Bool, _)>| {
            if message.is_none() {
                inbox.count_malformed(&name);
            }
            let enable = message.filter(|(message, _)| message.data);
            on(enable.map(|(_, info)| Origin::from(&info)));
        })
    }

    /// Calls `on` for each message of the reset topic.
    pub(crate) fn listen_to_reset(
        &mut self,
        topic: &str,
        inbox: &Arc<Inbox>,
        on: impl Fn(Origin) + Send + 'static,
    ) -> Result<Ear, BridgeError> {
        let inbox = Arc::clone(inbox);
        let name = topic.to_owned();
        self.hear(topic, "std_msgs/msg/Empty", commands(), move |message| match message {
            Some((Empty { .. }, info)) => on(Origin::from(&info)),
            None => inbox.count_malformed(&name),
        })
    }

    /// Calls `on` for each message of the speed limit topic. A message that cannot be decoded has
    /// no effect.
    pub(crate) fn listen_to_speed_limit(
        &mut self,
        topic: &str,
        inbox: &Arc<Inbox>,
        on: impl Fn(SpeedLimit) + Send + 'static,
    ) -> Result<Ear, BridgeError> {
        let inbox = Arc::clone(inbox);
        let name = topic.to_owned();
        let message_type = "nav2_msgs/msg/SpeedLimit";
        self.hear(topic, message_type, commands(), move |message: Option<(SpeedLimit, _)>| {
            match message {
                Some((limit, _)) if limit.speed_limit >= 0.0 => on(limit),
                _ => inbox.count_malformed(&name),
            }
        })
    }

    /// Returns the numbers of publishers of other participants on some topics.
    pub(crate) fn others_on<const N: usize>(&self, topics: [&str; N]) -> [usize; N] {
        let participant = self.context.domain_participant();
        // Our own publishers may be among the discovered ones.
        let ours = participant.guid().prefix;
        let writers = participant.discovered_writers();
        topics.map(|topic| {
            let dds_name = format!("rt{}", full_name(self.node.namespace(), topic));
            let theirs = writers.iter().filter(|writer| {
                writer.publication_topic_data.topic_name == dds_name
                    && writer.writer_proxy.remote_writer_guid.prefix != ours
            });
            theirs.count()
        })
    }

    /// Returns the package of the action's type, if a server for the action is on the network.
    pub(crate) fn action_package(&self, action: &str) -> Option<String> {
        let feedback = format!("rt{}/_action/feedback", full_name(self.node.namespace(), action));
        let writers = self.context.domain_participant().discovered_writers();
        let mut types = writers.into_iter().filter_map(|writer| {
            let topic = writer.publication_topic_data;
            (topic.topic_name == feedback).then_some(topic.type_name)
        });
        let package = types.next()?.split_once("::action::")?.0.to_owned();
        Some(package)
    }

    /// Creates the client of an action.
    pub(crate) fn action_client<G, R, F>(
        &mut self,
        action: &str,
        package: &str,
        kind: &str,
        mapping: ServiceMapping,
    ) -> Result<ActionClient<G, R, F>, BridgeError>
    where
        G: ros2_client::Message + Clone + 'static,
        R: ros2_client::Message + Clone + 'static,
        F: ros2_client::Message + 'static,
    {
        let name = name(self.node.namespace(), action)?;
        let answers = commands().history(History::KeepLast { depth: ANSWERS });
        let qos = ActionClientQosPolicies {
            goal_service: answers.clone(),
            result_service: answers.clone(),
            cancel_service: answers.clone(),
            feedback_subscription: answers,
            status_subscription: latched(),
        };
        let kind = ActionTypeName::new(package, kind);
        self.node.create_action_client(mapping, &name, &kind, qos).map_err(failed)
    }

    /// Returns the full name of a topic.
    pub(crate) fn full_name(&self, topic: &str) -> String {
        full_name(self.node.namespace(), topic)
    }

    /// Puts messages from which frames can be made into the inbox: images, and the scans and points
    /// of a pipeline without a camera. Their stamps set the clock.
    fn frames<M: FrameMessage>(
        &mut self,
        topic: &str,
        message_type: &str,
        depth: usize,
        inbox: &Arc<Inbox>,
        clock: &Arc<StampClock>,
    ) -> Result<Ear, BridgeError> {
        let clock = Arc::clone(clock);
        self.ear(topic, message_type, sensor(depth), inbox, move |message: M| {
            clock.record_arrival(message.stamp());
            (encode(&message), message.room())
        })
    }

    fn plain<M: Message + Serialize + DeserializeOwned + Send + 'static>(
        &mut self,
        topic: &str,
        qos: QosProfile,
        inbox: &Arc<Inbox>,
    ) -> Result<Ear, BridgeError> {
        self.ear(topic, M::TYPE, qos, inbox, |message: M| (encode(&message), OTHERS))
    }

    /// Puts the messages of a topic into the inbox. `encode` returns the bytes of a message, and
    /// the maximum number of messages of its topic that wait.
    fn ear<M: DeserializeOwned + Send + 'static>(
        &mut self,
        topic: &str,
        message_type: &str,
        qos: QosProfile,
        inbox: &Arc<Inbox>,
        encode: impl Fn(M) -> (Vec<u8>, usize) + Send + 'static,
    ) -> Result<Ear, BridgeError> {
        let inbox = Arc::clone(inbox);
        let name = topic.to_owned();
        let ours = participant_of(Gid::from(self.context.domain_participant().guid()));
        self.hear(topic, message_type, qos, move |message| match message {
            // The transforms that this node publishes are not an input.
            Some((_, info)) if participant_of(info.publisher_gid()) == ours => {}
            Some((message, _)) => {
                let (bytes, room) = encode(message);
                inbox.push(&name, bytes, room);
            }
            None => inbox.count_malformed(&name),
        })
    }

    /// Calls `take` for each message of a topic in a separate thread, with `None` for one that
    /// cannot be decoded.
    fn hear<M: DeserializeOwned + Send + 'static>(
        &mut self,
        topic: &str,
        message_type: &str,
        qos: QosProfile,
        take: impl Fn(Option<(M, MessageInfo)>) + Send + 'static,
    ) -> Result<Ear, BridgeError> {
        let node = &mut self.node;
        let full = name(node.namespace(), topic)?;
        let handle = node.create_topic(&full, kind(message_type), &qos).map_err(failed)?;
        let subscription: Subscription<M> =
            node.create_subscription(&handle, Some(qos)).map_err(failed)?;
        let (abort, registration) = AbortHandle::new_pair();
        let thread = threads::start("a topic", move || {
            // A message that cannot be decoded has another type than its topic states.
            let put = subscription.async_stream().for_each(|message| {
                take(message.ok());
                ready(())
            });
            // The stream ends when it is aborted.
            let _aborted = block_on(Abortable::new(put, registration));
        })?;
        Ok(Ear::new(topic, abort, thread))
    }

    /// Creates the server of a service.
    pub(crate) fn server<Q, A>(
        &mut self,
        service: &str,
        service_type: &str,
        mapping: ServiceMapping,
    ) -> Result<Server<Q, A>, BridgeError>
    where
        Q: ros2_client::Message + Clone + 'static,
        A: ros2_client::Message + 'static,
    {
        let (package, kind) = service_type.split_once("/srv/").unwrap_or(("", service_type));
        let name = name(self.node.namespace(), service)?;
        let kind = ServiceTypeName::new(package, kind);
        let answers = reliable().history(History::KeepLast { depth: ANSWERS });
        self.node.create_server(mapping, &name, &kind, commands(), answers).map_err(failed)
    }

    /// Creates a publisher of this type.
    pub(crate) fn publisher<M: Message + Serialize>(
        &mut self,
        topic: &str,
    ) -> Result<Publisher<M>, BridgeError> {
        self.publisher_of(topic, M::TYPE)
    }

    /// Creates a publisher of a type that does not occur in logs.
    pub(crate) fn publisher_of<M: Serialize>(
        &mut self,
        topic: &str,
        message_type: &str,
    ) -> Result<Publisher<M>, BridgeError> {
        self.publisher_with(topic, message_type, reliable())
    }

    /// Creates a publisher whose last message also reaches late subscribers, as for maps.
    pub(crate) fn kept_publisher<M: Serialize>(
        &mut self,
        topic: &str,
        message_type: &str,
    ) -> Result<Publisher<M>, BridgeError> {
        self.publisher_with(topic, message_type, reliable().durability(Durability::TransientLocal))
    }

    /// Creates a publisher of a sequence of messages of which none may be missed.
    pub(crate) fn event_publisher<M: Serialize>(
        &mut self,
        topic: &str,
        message_type: &str,
    ) -> Result<Publisher<M>, BridgeError> {
        let qos = reliable().history(History::KeepLast { depth: EVENTS });
        self.publisher_with(topic, message_type, qos)
    }

    fn publisher_with<M: Serialize>(
        &mut self,
        topic: &str,
        message_type: &str,
        qos: QosProfile,
    ) -> Result<Publisher<M>, BridgeError> {
        let node = &mut self.node;
        let name = name(node.namespace(), topic)?;
        let handle = node.create_topic(&name, kind(message_type), &qos).map_err(failed)?;
        node.create_publisher(&handle, Some(qos)).map_err(failed)
    }
}

/// Returns the part of a GID that all publishers of a participant share.
fn participant_of(publisher: Gid) -> Vec<u8> {
    publisher.to_bytes16()[..12].to_vec()
}

/// Returns the name of a topic, which is in the namespace unless it begins with a slash.
/// (ros2-client itself doubles the slash in the namespace `/`.)
fn name(namespace: &str, topic: &str) -> Result<Name, BridgeError> {
    let full = full_name(namespace, topic);
    Name::parse(&full).map_err(|error| BridgeError::Config(format!("topic `{topic}`: {error:?}")))
}

fn full_name(namespace: &str, topic: &str) -> String {
    if topic.starts_with('/') {
        topic.to_owned()
    } else {
        format!("{}/{topic}", namespace.trim_end_matches('/'))
    }
}

fn kind(message_type: &str) -> MessageTypeName {
    let (package, name) = message_type.split_once("/msg/").unwrap_or(("", message_type));
    MessageTypeName::new(package, name)
}

impl Drop for Network {
    fn drop(&mut self) {
        self.node.stop_spinner();
        self.spinner.take().map(JoinHandle::join);
    }
}

#[cfg(test)]
mod tests {
    use tagalong::log::msgs::TransformStamped;

    use super::*;

    #[test]
    fn names_without_a_slash_lie_in_the_namespace() {
        for (namespace, topic, full) in [
            ("/", "people/tracks", "/people/tracks"),
            ("/robot1", "cmd_vel", "/robot1/cmd_vel"),
            ("/robot1", "/cmd_vel", "/cmd_vel"),
        ] {
            assert_eq!(name(namespace, topic).unwrap(), Name::parse(full).unwrap());
        }
        assert!(matches!(name("/", "no spaces"), Err(BridgeError::Config(_))));
    }

    #[test]
    fn a_message_of_any_type_is_put_into_the_inbox_as_it_lies_on_the_wire() {
        // A domain that the other tests do not use.
        let domain = 99 - (std::process::id() % 50) as u16;
        let mut base = Network::join(domain, "/").unwrap();
        let mut bridge = Network::join(domain, "/").unwrap();
        let kind = "kobuki_ros_interfaces/msg/BumperEvent";
        let publisher = base.publisher_of::<(u8, u8)>("/bumper", kind).unwrap();
        let inbox = Arc::new(Inbox::default());
        let _ear = bridge.listen_raw("/bumper", kind, &inbox).unwrap();
        // The first messages come before the two know each other.
        let heard = (0..100).find_map(|_| {
            let _full = publisher.publish((2, 1));
            inbox.take(std::time::Duration::from_millis(100)).pop()
        });
        let Some(heard) = heard else {
            eprintln!("skipped: two participants do not hear each other here (no multicast?)");
            return;
        };
        assert_eq!(heard.topic, "/bumper");
        // DDS fills messages up to a multiple of four bytes.
        assert!(heard.message.starts_with(&[0, 1, 0, 0, 2, 1]), "{:?}", heard.message);
        assert!(heard.arrival_ns > 0);
    }

    #[test]
    fn a_node_does_not_hear_itself() {
        let domain = 30 - (std::process::id() % 20) as u16;
        let mut other = Network::join(domain, "/").unwrap();
        let mut bridge = Network::join(domain, "/").unwrap();
        let inbox = Arc::new(Inbox::default());
        let own: Publisher<TFMessage> = bridge.publisher("/tf").unwrap();
        let _ear = bridge.plain::<TFMessage>("/tf", sensor(OTHERS), &inbox).unwrap();
        let theirs: Publisher<TFMessage> = other.publisher("/tf").unwrap();
        let [person, base_link] = ["person_1", "base_link"].map(|child| {
            let child_frame_id = child.to_owned();
            TFMessage {
                transforms: vec![TransformStamped { child_frame_id, ..Default::default() }],
            }
        });
        let mut heard = Vec::new();
        for _ in 0..100 {
            let _full = own.publish(person.clone());
            let _full = theirs.publish(base_link.clone());
            heard.extend(inbox.take(std::time::Duration::from_millis(100)));
            if heard.len() > 5 {
                break;
            }
        }
        if heard.is_empty() {
            eprintln!("skipped: two participants do not hear each other here (no multicast?)");
        }
        for arrival in heard {
            let tf: TFMessage = tagalong::log::msgs::decode(&arrival.message).unwrap();
            assert_eq!(tf.transforms[0].child_frame_id, "base_link");
        }
    }
}
