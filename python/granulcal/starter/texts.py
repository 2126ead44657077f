"""The commented files of `granulcal init`; numbers are put in by name."""

__all__ = ["CAMERA", "DROP_START", "FUNNEL_START", "LOOP", "PRIOR", "SCENE"]

SCENE = """\
# What is poured, onto what, and who looks at it. Lengths in metres, angles in radians; docs/scenes.md has every key.
#   granulcal simulate scene.toml --seed 1           one pour
#   granulcal scene scene.toml                       every number of it, those that are left out here too
name = "{name}"
preset = "{preset}"            # fast, default or accurate: how fine the solver steps

# The material is what the recording is asked for; these numbers are only where `simulate` begins.
[material]
sliding_friction = 0.5        # Coulomb's coefficient
rolling_friction = 0.1        # moment that rolling withstands, over normal force and effective radius
restitution = 0.5             # speed after an impact over the speed before it

[grains]
count = {count}                 # weigh all grains and a hundred of them, and divide
diameter = {diameter:g}              # of a sphere of the same volume: a calliper, or the volume of a hundred in water
density = 1300.0              # kg/m^3; of no influence on a dry pour
{start}
[end]
horizon = 4.0                 # seconds at most; a pour ends when it rests

# The camera that will look at the real pile. Images are compared at one width of a pixel on the ground:
# field_width / pixels * downsample, here {resolution_mm:.1f} mm, {in_grains:.1f} grain diameters.
[camera]
projection = "pinhole"
height = {height:g}                  # of the camera above the ground
field_width = {field_width:g}             # side of the square of ground that it sees
pixels = {pixels}                  # along that side
downsample = {downsample}
height_threshold = {threshold:g}      # a pixel counts as grain above it: three times the noise, at least 1 mm

# [camera.sensor]             # the noise of your own camera: paste what `granulcal fit-sensor wall.bag -o` wrote,
#                             # or leave it out and give --sensor sensor.toml to `generate`
"""

FUNNEL_START = """
# A block of grains about the axis, its lowest layer 4 mm below the funnel's rim.
[start]
kind = "grid"
counts = [10, 10, 20]         # at least as many places as grains
spacing = {spacing:g}               # larger than a grain
jitter = {jitter:g}
base = {base:g}

[funnel]
height = {tip:g}                 # of the tip above the ground: measure it, half a millimetre is worth the while
rim_radius = 0.06
stem_radius = 0.016           # the narrow end; grains jam below about 2.5 diameters of opening radius
cone_length = 0.07
stem_length = 0.01
"""

DROP_START = """
# A ball of grains that is let go.
[start]
kind = "ball"
height = {tip:g}                 # of its lowest point above the ground
solid_fraction = 0.5
jitter = {jitter:g}
"""

PRIOR = """\
# What is unknown, and how far it may be off before the recording is seen.
#   granulcal generate scene.toml prior.toml -n 1000 -o pours
# A path names a number of the scene. Distributions: uniform and log_uniform {low, high}, normal {mean, sd, and low or
# high to cut it off}, fixed {value}. Narrow it where you know more; what lies outside can never be found.
[[parameter]]
path = "material.sliding_friction"
distribution = "uniform"
low = 0.0
high = 1.0

[[parameter]]
path = "material.rolling_friction"
distribution = "log_uniform"
low = 1e-3
high = 1.0

[[parameter]]
path = "material.restitution"
distribution = "uniform"
low = 0.0
high = 1.0

# Something that was set up by eye is unknown, too:
# [[parameter]]
# path = "funnel.height"
# distribution = "normal"
# mean = 0.12
# sd = 0.002
# low = 0.11
# high = 0.13
"""

CAMERA = """\
# The lens of the depth camera, and how its images become heights. {origin}
#   granulcal features couscous.png --camera camera.toml
# A .bag or .mcap has a lens and a unit of its own: for one, leave the numbers above [segmentation] out, since they
# replace its own (which is said where they differ).
# cx and cy as OpenCV and the RealSense SDK give them: the first pixel's centre is (0, 0).
width = {width}
height = {height}
fx = {fx:.6g}
fy = {fy:.6g}
cx = {cx:.6g}
cy = {cy:.6g}
depth_unit = {unit:g}          # metres per count of the 16-bit PNG; a RealSense has 0.001 unless it was told another

[segmentation]
border_px = 0                 # ignore a frame of so many pixels
# region = [170, 120, 300, 240] # look at this part alone, x, y, width, height: a tray's floor without rim and table
max_height = {max_height:g}             # no data above it: the funnel, a hand
height_threshold = {{ absolute = {threshold:g} }}   # as in scene.toml, and three times the ground's noise or more
"""

LOOP = """\
# What does the model lack? Recordings of one material under several conditions, three pours to fit at least.
#   granulcal close-loop loop.toml -o loop
scene = "scene.toml"
prior = "prior.toml"
camera = "camera.toml"        # of the PNGs

# effects = ["drag", "tilt.x"]          # what to test, by name; left out: the 22 of a funnel's pour (21 at one height)
#                                       # ["usual", "clump", "ground.layer"]: these, rods and a soft table as well
# nuisances = {{ "tilt.x" = 0.005 }}      # what may be off by that much and is no finding; {{ sd = 0.005, shared = false }}
#                                       # where each condition has its own, or each session = "..." of conditions

[[conditions]]
name = "low"
at = {{ "{path}" = {low:g} }}
use = "fit"                   # or "sealed": opened once, after the verdict
recordings = {low_names}

[[conditions]]
name = "high"
at = {{ "{path}" = {high:g} }}
use = "fit"
recordings = {high_names}
"""
