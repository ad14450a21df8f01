"""ROS 2 as a guest who needs no ROS: topics over DDS, by the `cyclonedds` package."""
