"""The qualities of service of topics that need another one than rclpy's default."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""A subscriber that comes later gets the last message, too."""
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Only the newest message matters. Best effort hears every publisher, reliable only the reliable
ones; what is lost on the way is replaced by the next message, not sent again late."""
