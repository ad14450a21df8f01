"""Makes the recordings beside this file with librealsense's own software device and recorder: depth and color, extrinsics
that are not the identity.

    pip install pyrealsense2==2.55.1.6486 && python tests/data/realsense/make.py tests/data/realsense/recorded_2_55.bag
    pip install pyrealsense2==2.59.1.11053 && python tests/data/realsense/make.py tests/data/realsense/recorded_2_59.db3
"""

import gc
import sys
import time

import numpy as np
import pyrealsense2 as rs

WIDTH, HEIGHT, FRAMES = 64, 48, 6
COLOR_WIDTH, COLOR_HEIGHT = 80, 60
TURN = 0.1  # rad about the optical axis


def intrinsics(width, height, focal, model, coefficients):
    found = rs.intrinsics()
    found.width, found.height, found.fx, found.fy = width, height, focal, focal
    found.ppx, found.ppy = width / 2, height / 2 - 0.75
    found.model, found.coeffs = model, coefficients
    return found


def stream(sensor, kind, uid, form, depth_of_pixel, lens):
    video = rs.video_stream()
    video.type, video.index, video.uid, video.fps, video.fmt = kind, 0, uid, 30, form
    video.width, video.height, video.bpp, video.intrinsics = lens.width, lens.height, depth_of_pixel, lens
    return sensor.add_video_stream(video).as_video_stream_profile()


def frame(sensor, profile, pixels, number, bytes_of_pixel):
    made = rs.software_video_frame()
    made.pixels, made.stride, made.bpp = pixels, pixels.shape[1] * bytes_of_pixel, bytes_of_pixel
    made.timestamp, made.domain = 1000.0 * (100 + number / 30), rs.timestamp_domain.system_time
    made.frame_number, made.profile = number + 1, profile
    if bytes_of_pixel == 2:
        made.depth_units = 0.001
    sensor.on_video_frame(made)


device = rs.software_device()
depth, color = device.add_sensor("Stereo Module"), device.add_sensor("RGB Camera")
flat = intrinsics(WIDTH, HEIGHT, 60.0, rs.distortion.brown_conrady, [0.0] * 5)
bent = [0.05, -0.02, 0.001, -0.001, 0.0]
lens = intrinsics(COLOR_WIDTH, COLOR_HEIGHT, 75.0, rs.distortion.inverse_brown_conrady, bent)
depth_profile = stream(depth, rs.stream.depth, 0, rs.format.z16, 2, flat)
color_profile = stream(color, rs.stream.color, 1, rs.format.rgb8, 3, lens)
depth.add_read_only_option(rs.option.depth_units, 0.001)
color_from_depth = rs.extrinsics()
color_from_depth.rotation = [np.cos(TURN), np.sin(TURN), 0, -np.sin(TURN), np.cos(TURN), 0, 0, 0, 1]  # columns
color_from_depth.translation = [0.015, -0.002, 0.001]
depth_profile.register_extrinsics_to(color_profile, color_from_depth)
device.create_matcher(rs.matchers.default)
recorder = rs.recorder(sys.argv[1], device)
recorded = recorder.query_sensors()
for sensor in recorded:
    sensor.open(sensor.get_stream_profiles()[0])
    sensor.start(lambda _: None)
for number in range(FRAMES):
    image = np.full((HEIGHT, WIDTH), 2000 + number, np.uint16)
    image[:, :8] = 0
    frame(depth, depth_profile, image, number, 2)
    picture = np.zeros((COLOR_HEIGHT, COLOR_WIDTH, 3), np.uint8)
    picture[..., 0], picture[..., 2] = 200, number
    frame(color, color_profile, picture, number, 3)
    time.sleep(0.05)
for sensor in recorded:
    sensor.stop()
    sensor.close()
# The file is complete when nothing holds the recorder.
del sensor, recorded, recorder
gc.collect()
