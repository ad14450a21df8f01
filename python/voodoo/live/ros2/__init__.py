"""ROS 2 topics without a ROS installation: DDS by the `cyclonedds` package."""
