//! A robot by a ROS 2 client library that nobody here wrote: it says where it is, how fast, over
//! which ground and along which path, and prints as JSON what limits, profiles and diagnostics came.
//!
//! ZENOH_CONFIG_OVERRIDE says where the router is. Argument: seconds.

use std::{
    thread::sleep,
    time::{Duration, Instant, SystemTime},
};

use ros2_client::{Context, MessageTypeName, Name, Node, NodeName, NodeOptions, QosProfile};
use serde::{Deserialize, Serialize};

type Error = Box<dyn std::error::Error + Send + Sync>;

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Header {
    sec: i32,
    nanosec: u32,
    frame_id: String,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Vector3 {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Quaternion {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Pose {
    position: Vector3,
    orientation: Quaternion,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct PoseStamped {
    header: Header,
    pose: Pose,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Path {
    header: Header,
    poses: Vec<PoseStamped>,
}

/// 36 numbers; serde knows arrays up to 32.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Covariance([f64; 18], [f64; 18]);

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Odometry {
    header: Header,
    child_frame_id: String,
    pose: Pose,
    pose_covariance: Covariance,
    linear: Vector3,
    angular: Vector3,
    twist_covariance: Covariance,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Dimension {
    label: String,
    size: u32,
    stride: u32,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Layer {
    dim: Vec<Dimension>,
    data_offset: u32,
    data: Vec<f32>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct GridMap {
    header: Header,
    resolution: f64,
    length_x: f64,
    length_y: f64,
    pose: Pose,
    layers: Vec<String>,
    basic_layers: Vec<String>,
    data: Vec<Layer>,
    outer_start_index: u16,
    inner_start_index: u16,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct SpeedLimit {
    header: Header,
    percentage: bool,
    speed_limit: f64,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct KeyValue {
    key: String,
    value: String,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Status {
    level: u8,
    name: String,
    message: String,
    hardware_id: String,
    values: Vec<KeyValue>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct DiagnosticArray {
    header: Header,
    status: Vec<Status>,
}

fn header() -> Header {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    Header { sec: now.as_secs() as i32, nanosec: now.subsec_nanos(), frame_id: "odom".into() }
}

fn pose(x: f64) -> Pose {
    let orientation = Quaternion { w: 1.0, ..Default::default() };
    Pose { position: Vector3 { x, y: 0.0, z: 0.0 }, orientation }
}

fn ground() -> GridMap {
    let (rows, columns, cell) = (200, 80, 0.25);
    let dimension = |label: &str, size: u32, stride: u32| Dimension { label: label.into(), size, stride };
    let dim = vec![
        dimension("column_index", columns, rows * columns),
        dimension("row_index", rows, rows),
    ];
    let data = vec![0.0; (rows * columns) as usize];
    GridMap {
        header: header(),
        resolution: cell,
        length_x: f64::from(rows) * cell,
        length_y: f64::from(columns) * cell,
        pose: pose(15.0),
        layers: vec!["elevation".into()],
        basic_layers: vec!["elevation".into()],
        data: vec![Layer { dim, data_offset: 0, data }],
        ..Default::default()
    }
}

fn topic(node: &Node, name: &str, package: &str, kind: &str) -> Result<ros2_client::Topic, Error> {
    let named = Name::new("/", name)?;
    let typed = MessageTypeName::new(package, kind);
    Ok(node.create_topic(&named, typed, &QosProfile::publisher_default()))
}

fn main() -> Result<(), Error> {
    let seconds: f64 = std::env::args().nth(1).and_then(|s| s.parse().ok()).unwrap_or(3.0);
    let node = Context::new()?
        .new_node(NodeName::new("/", "robot")?, NodeOptions::new().enable_rosout(false))?;
    let paths = node.create_publisher::<Path>(&topic(&node, "plan", "nav_msgs", "Path")?, None)?;
    let odometry =
        node.create_publisher::<Odometry>(&topic(&node, "odom", "nav_msgs", "Odometry")?, None)?;
    let maps = node.create_publisher::<GridMap>(
        &topic(&node, "elevation_map", "grid_map_msgs", "GridMap")?, None)?;
    let limits = node.create_subscription::<SpeedLimit>(
        &topic(&node, "speed_limit", "nav2_msgs", "SpeedLimit")?, None)?;
    let profiles =
        node.create_subscription::<Path>(&topic(&node, "speed_plan", "nav_msgs", "Path")?, None)?;
    let diagnostics = node.create_subscription::<DiagnosticArray>(
        &topic(&node, "diagnostics", "diagnostic_msgs", "DiagnosticArray")?, None)?;

    let along = |k: i32| PoseStamped { header: header(), pose: pose(0.5 * f64::from(k)) };
    let path = Path { header: header(), poses: (0..60).map(along).collect() };
    let linear = Vector3 { x: 1.0, ..Default::default() };
    let (mut told, mut planned, mut said) = (vec![], vec![], vec![]);
    let begun = Instant::now();
    let mut round = 0;
    while begun.elapsed().as_secs_f64() < seconds {
        if round % 50 == 0 {
            maps.publish(ground())?;
        }
        odometry.publish(Odometry {
            header: header(),
            child_frame_id: "base_link".into(),
            pose: pose(0.0),
            linear,
            ..Default::default()
        })?;
        if round % 5 == 0 {
            paths.publish(path.clone())?;
        }
        while let Some((limit, _)) = limits.try_take()? {
            told.push(limit.speed_limit);
        }
        while let Some((profile, _)) = profiles.try_take()? {
            planned.push(profile.poses.len());
        }
        while let Some((one, _)) = diagnostics.try_take()? {
            said = one.status.iter().map(|s| (s.level, s.message.clone())).collect();
        }
        round += 1;
        sleep(Duration::from_millis(20));
    }
    println!(
        "{}",
        serde_json::json!({"limits": told, "profiles": planned, "diagnostics": said})
    );
    Ok(())
}
