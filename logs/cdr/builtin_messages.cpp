// Common messages of ROS 2, by what their interfaces are: the order and types of their fields.
#include <string_view>
#include <utility>

#include "rhec/logs/cdr/message_definitions.hpp"

namespace rhec::logs {
namespace {

using Entry = std::pair<const char*, const char*>;

constexpr Entry messages[] = {
    {"builtin_interfaces/msg/Time", "int32 sec\nuint32 nanosec"},
    {"builtin_interfaces/msg/Duration", "int32 sec\nuint32 nanosec"},
    {"rosgraph_msgs/msg/Clock", "builtin_interfaces/Time clock"},
    {"std_msgs/msg/Header", "builtin_interfaces/Time stamp\nstring frame_id"},
    {"std_msgs/msg/Bool", "bool data"},
    {"std_msgs/msg/Byte", "byte data"},
    {"std_msgs/msg/Char", "char data"},
    {"std_msgs/msg/Float32", "float32 data"},
    {"std_msgs/msg/Float64", "float64 data"},
    {"std_msgs/msg/Int8", "int8 data"},
    {"std_msgs/msg/Int16", "int16 data"},
    {"std_msgs/msg/Int32", "int32 data"},
    {"std_msgs/msg/Int64", "int64 data"},
    {"std_msgs/msg/UInt8", "uint8 data"},
    {"std_msgs/msg/UInt16", "uint16 data"},
    {"std_msgs/msg/UInt32", "uint32 data"},
    {"std_msgs/msg/UInt64", "uint64 data"},
    {"std_msgs/msg/String", "string data"},
    {"std_msgs/msg/Empty", ""},
    {"std_msgs/msg/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a"},
    {"std_msgs/msg/MultiArrayDimension", "string label\nuint32 size\nuint32 stride"},
    {"std_msgs/msg/MultiArrayLayout", "MultiArrayDimension[] dim\nuint32 data_offset"},
    {"std_msgs/msg/Float32MultiArray", "MultiArrayLayout layout\nfloat32[] data"},
    {"std_msgs/msg/Float64MultiArray", "MultiArrayLayout layout\nfloat64[] data"},
    {"std_msgs/msg/Int32MultiArray", "MultiArrayLayout layout\nint32[] data"},
    {"std_msgs/msg/Int64MultiArray", "MultiArrayLayout layout\nint64[] data"},
    {"geometry_msgs/msg/Vector3", "float64 x\nfloat64 y\nfloat64 z"},
    {"geometry_msgs/msg/Vector3Stamped", "std_msgs/Header header\nVector3 vector"},
    {"geometry_msgs/msg/Point", "float64 x\nfloat64 y\nfloat64 z"},
    {"geometry_msgs/msg/Point32", "float32 x\nfloat32 y\nfloat32 z"},
    {"geometry_msgs/msg/Polygon", "Point32[] points"},
    {"geometry_msgs/msg/PolygonStamped", "std_msgs/Header header\nPolygon polygon"},
    {"geometry_msgs/msg/PointStamped", "std_msgs/Header header\nPoint point"},
    {"geometry_msgs/msg/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w"},
    {"geometry_msgs/msg/QuaternionStamped", "std_msgs/Header header\nQuaternion quaternion"},
    {"geometry_msgs/msg/Pose", "Point position\nQuaternion orientation"},
    {"geometry_msgs/msg/Pose2D", "float64 x\nfloat64 y\nfloat64 theta"},
    {"geometry_msgs/msg/PoseStamped", "std_msgs/Header header\nPose pose"},
    {"geometry_msgs/msg/PoseArray", "std_msgs/Header header\nPose[] poses"},
    {"geometry_msgs/msg/PoseWithCovariance", "Pose pose\nfloat64[36] covariance"},
    {"geometry_msgs/msg/PoseWithCovarianceStamped", "std_msgs/Header header\nPoseWithCovariance pose"},
    {"geometry_msgs/msg/Twist", "Vector3 linear\nVector3 angular"},
    {"geometry_msgs/msg/TwistStamped", "std_msgs/Header header\nTwist twist"},
    {"geometry_msgs/msg/TwistWithCovariance", "Twist twist\nfloat64[36] covariance"},
    {"geometry_msgs/msg/TwistWithCovarianceStamped", "std_msgs/Header header\nTwistWithCovariance twist"},
    {"geometry_msgs/msg/Accel", "Vector3 linear\nVector3 angular"},
    {"geometry_msgs/msg/AccelStamped", "std_msgs/Header header\nAccel accel"},
    {"geometry_msgs/msg/AccelWithCovariance", "Accel accel\nfloat64[36] covariance"},
    {"geometry_msgs/msg/AccelWithCovarianceStamped", "std_msgs/Header header\nAccelWithCovariance accel"},
    {"geometry_msgs/msg/Wrench", "Vector3 force\nVector3 torque"},
    {"geometry_msgs/msg/WrenchStamped", "std_msgs/Header header\nWrench wrench"},
    {"geometry_msgs/msg/Transform", "Vector3 translation\nQuaternion rotation"},
    {"geometry_msgs/msg/TransformStamped", "std_msgs/Header header\nstring child_frame_id\nTransform transform"},
    {"tf2_msgs/msg/TFMessage", "geometry_msgs/TransformStamped[] transforms"},
    {"nav_msgs/msg/Odometry",
     "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
     "geometry_msgs/TwistWithCovariance twist"},
    {"nav_msgs/msg/Path", "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses"},
    {"sensor_msgs/msg/NavSatStatus", "int8 status\nuint16 service"},
    {"sensor_msgs/msg/NavSatFix",
     "std_msgs/Header header\nNavSatStatus status\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\n"
     "float64[9] position_covariance\nuint8 position_covariance_type"},
    {"sensor_msgs/msg/Imu",
     "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
     "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
     "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance"},
    {"sensor_msgs/msg/JointState",
     "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort"},
    {"sensor_msgs/msg/MagneticField",
     "std_msgs/Header header\ngeometry_msgs/Vector3 magnetic_field\nfloat64[9] magnetic_field_covariance"},
    {"sensor_msgs/msg/FluidPressure", "std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance"},
    {"sensor_msgs/msg/Temperature", "std_msgs/Header header\nfloat64 temperature\nfloat64 variance"},
    {"sensor_msgs/msg/Range",
     "std_msgs/Header header\nuint8 radiation_type\nfloat32 field_of_view\nfloat32 min_range\nfloat32 max_range\n"
     "float32 range\nfloat32 variance"},
    {"sensor_msgs/msg/Joy", "std_msgs/Header header\nfloat32[] axes\nint32[] buttons"},
    {"sensor_msgs/msg/TimeReference", "std_msgs/Header header\nbuiltin_interfaces/Time time_ref\nstring source"},
    {"ackermann_msgs/msg/AckermannDrive",
     "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk"},
    {"ackermann_msgs/msg/AckermannDriveStamped", "std_msgs/Header header\nAckermannDrive drive"},
    {"diagnostic_msgs/msg/KeyValue", "string key\nstring value"},
    {"diagnostic_msgs/msg/DiagnosticStatus",
     "byte level\nstring name\nstring message\nstring hardware_id\nKeyValue[] values"},
    {"diagnostic_msgs/msg/DiagnosticArray", "std_msgs/Header header\nDiagnosticStatus[] status"},
    {"costmap_converter_msgs/msg/ObstacleMsg",
     "std_msgs/Header header\ngeometry_msgs/Polygon polygon\nfloat64 radius\nint64 id\n"
     "geometry_msgs/Quaternion orientation\ngeometry_msgs/TwistWithCovariance velocities"},
    {"costmap_converter_msgs/msg/ObstacleArrayMsg", "std_msgs/Header header\nObstacleMsg[] obstacles"},
    {"control_msgs/msg/DynamicJointState",
     "std_msgs/Header header\nstring[] joint_names\nInterfaceValue[] interface_values"},
    {"control_msgs/msg/InterfaceValue", "string[] interface_names\nfloat64[] values"},
    {"geographic_msgs/msg/GeoPoint", "float64 latitude\nfloat64 longitude\nfloat64 altitude"},
    {"geographic_msgs/msg/GeoPointStamped", "std_msgs/Header header\nGeoPoint position"},
    {"geographic_msgs/msg/GeoPose", "GeoPoint position\ngeometry_msgs/Quaternion orientation"},
    {"geographic_msgs/msg/GeoPoseStamped", "std_msgs/Header header\nGeoPose pose"},
};

}  // namespace

const Definitions& builtin_definitions() {
  static const Definitions all = [] {
    Definitions definitions;
    for (const auto& [type, text] : messages) parse_ros2msg(type, text, definitions);
    return definitions;
  }();
  return all;
}

}  // namespace rhec::logs
