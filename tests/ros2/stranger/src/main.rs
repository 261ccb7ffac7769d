//! A node that measures what the node of rhec estimates from, hears its estimates, and says what it finds in the graph of ROS:
//! stranger DOMAIN SECONDS. It ends with 0 once it has found and heard everything.
use futures::StreamExt;
use ros2_client::{
  entities_info::ParticipantEntitiesInfo, qos::History, Context, Message, MessageTypeName, Name, NodeEvent, NodeName, NodeOptions, QosProfile,
};
use rustdds::DomainParticipantBuilder;
use serde::{Deserialize, Serialize};
use std::{
  cell::RefCell,
  collections::BTreeSet,
  net::IpAddr,
  process::exit,
  time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Time {
  sec: i32,
  nanosec: u32,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Header {
  stamp: Time,
  frame_id: String,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct JointState {
  header: Header,
  name: Vec<String>,
  position: Vec<f64>,
  velocity: Vec<f64>,
  effort: Vec<f64>,
}
impl Message for JointState {}

fn now() -> Time {
  let since = SystemTime::now().duration_since(UNIX_EPOCH).expect("a time after 1970");
  Time { sec: since.as_secs() as i32, nanosec: since.subsec_nanos() }
}

/// A robot at rest, with some noise, or it would seem stuck.
fn measurement(count: u32) -> JointState {
  JointState {
    header: Header { stamp: now(), frame_id: "base_link".into() },
    name: ["x_gps", "y_gps", "heading"].map(String::from).to_vec(),
    position: vec![0.01 * f64::from(count % 3), 0.0, 0.002 * f64::from(count % 2)],
    velocity: vec![],
    effort: vec![],
  }
}

#[derive(Default)]
struct Found {
  nodes: BTreeSet<String>,
  topics: BTreeSet<(String, String)>,
  heard: Option<JointState>,
  heard_count: usize,
}

impl Found {
  fn note(&mut self, info: &ParticipantEntitiesInfo) {
    for node in info.nodes() {
      self.nodes.insert(node.fully_qualified_name());
    }
  }
  fn is_all(&self) -> bool {
    let has = |topic: &str| self.topics.iter().any(|(name, _)| name == topic);
    self.nodes.contains("/rhec") && self.heard_count >= 20 && has("rt/rhec/odometry") && has("rt/tf")
  }
}

fn main() {
  let arguments: Vec<String> = std::env::args().collect();
  let domain: u16 = arguments[1].parse().expect("a domain");
  let end = Instant::now() + Duration::from_secs_f64(arguments[2].parse().expect("seconds"));

  let loopback: IpAddr = "127.0.0.1".parse().expect("an address");
  let participant = DomainParticipantBuilder::new(domain).with_only_networks([loopback]).build().expect("a participant");
  let context = Context::from_domain_participant(participant).expect("a context");
  let mut node = context
    .new_node(NodeName::new("/", "stranger").expect("a name"), NodeOptions::new().enable_rosout(false))
    .expect("a node");
  let quality = QosProfile::publisher_default().history(History::KeepLast { depth: 10 });
  let topic = |name: &str| {
    node
      .create_topic(&Name::new("/rhec", name).expect("a name"), MessageTypeName::new("sensor_msgs", "JointState"), &quality)
      .expect("a topic")
  };
  let (measured, state) = (topic("measured"), topic("state"));
  let publisher = node.create_publisher::<JointState>(&measured, None).expect("a publisher");
  let subscription = node.create_subscription::<JointState>(&state, None).expect("a subscription");
  let executor = smol::LocalExecutor::new();
  let spinner = node.spinner().expect("a spinner");
  let events = node.status_receiver().expect("what happens");
  executor.spawn(spinner.spin()).detach();

  let found = RefCell::new(Found::default());
  let graph = events.for_each(|event| {
    if let NodeEvent::ParticipantEntities(info) = &event {
      found.borrow_mut().note(info);
    }
    async {}
  });
  let hears = subscription.async_stream().for_each(|message| {
    if let Ok((message, _)) = message {
      let mut found = found.borrow_mut();
      found.heard_count += 1;
      found.heard = Some(message);
    }
    async {}
  });
  let measures = async {
    let mut count = 0;
    while Instant::now() < end && !found.borrow().is_all() {
      count += 1;
      if let Err(error) = publisher.async_publish(measurement(count)).await {
        eprintln!("a measurement was not sent: {error:?}");
      }
      smol::Timer::after(Duration::from_millis(50)).await;
      for each in context.discovered_topics_raw() {
        found.borrow_mut().topics.insert((each.topic_name().clone(), each.type_name().clone()));
      }
    }
  };
  futures::pin_mut!(graph, hears, measures);
  let others = futures::future::join(graph, hears);
  smol::block_on(executor.run(futures::future::select(measures, others)));

  let found = found.borrow();
  for node in &found.nodes {
    println!("node {node}");
  }
  for (name, kind) in &found.topics {
    println!("topic {name} {kind}");
  }
  println!("heard {}", found.heard_count);
  if let Some(message) = &found.heard {
    println!("state {:?} {:?} {}", message.name, message.position, message.header.frame_id);
  }
  exit(if found.is_all() { 0 } else { 1 });
}
