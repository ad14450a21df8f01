"""From a recording to estimates: inputs, the front end, the loop, inverse kinematics."""
