"""The Go2's rigid bodies as URDF text, from the figures in the project's fact sheet (unitree_ros d6f13aa).

The table gives the front-left (FL) leg; `s` is +1 left and -1 right, `f` is +1 front and -1 rear.
Link and joint names are Unitree's, legs are listed in Unitree's URDF order (FL, FR, RL, RR).
"""

TOTAL_MASS = 16.087  # kg, rotors included

# mass (kg), com (m), inertia about the com (kg m2): ixx, ixy, ixz, iyy, iyz, izz
BASE = (6.921, (0.021112, 0, -0.005366), (0.02448, 1.2166e-4, 1.4849e-3, 0.098077, -3.12e-5, 0.107))
HIP = (0.678, (-0.0054, 0.00194, -0.000105), (4.80e-4, -3.01e-6, 1.11e-6, 8.84e-4, -1.42e-6, 5.96e-4))
THIGH = (1.152, (-0.00374, -0.0223, -0.0327), (5.84e-3, 8.72e-5, -2.89e-4, 5.80e-3, 8.08e-4, 1.03e-3))
CALF = (0.154, (0.00548, -0.000975, -0.115), (1.08e-3, 3.4e-7, 1.72e-5, 1.10e-3, 8.28e-6, 3.29e-5))
HEAD = (0.001, (0, 0, 0), (9.6e-6, 0, 0, 9.6e-6, 0, 9.6e-6))
FOOT = (0.04, (0, 0, 0), (9.6e-6, 0, 0, 9.6e-6, 0, 9.6e-6))
ROTOR_X = (0.089, (0, 0, 0), (1.11842e-4, 0, 0, 5.9647e-5, 0, 5.9647e-5))
ROTOR_Y = (0.089, (0, 0, 0), (5.9647e-5, 0, 0, 1.11842e-4, 0, 5.9647e-5))

LEGS = {"FL": (1, 1), "FR": (-1, 1), "RL": (1, -1), "RR": (-1, -1)}  # name: (s, f)

HIP_LIMITS = (-1.0472, 1.0472, 23.7, 30.1)  # lower, upper (rad), effort (N m), velocity (rad/s)
THIGH_LIMITS = {1: (-1.5708, 3.4907, 23.7, 30.1), -1: (-0.5236, 4.5379, 23.7, 30.1)}  # by f
CALF_LIMITS = (-2.7227, -0.83776, 45.43, 15.70)


def numbers(values):
    return " ".join(f"{value:.10g}" for value in values)


def flip_x(body):
    """Mirrors a body in the y-z plane (rear hips)."""
    m, (x, y, z), (ixx, ixy, ixz, iyy, iyz, izz) = body
    return m, (-x, y, z), (ixx, -ixy, -ixz, iyy, iyz, izz)


def flip_y(body):
    """Mirrors a body in the x-z plane (right legs)."""
    m, (x, y, z), (ixx, ixy, ixz, iyy, iyz, izz) = body
    return m, (x, -y, z), (ixx, -ixy, ixz, iyy, -iyz, izz)


def link(name, body):
    mass, com, inertia = body
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    attributes = " ".join(f'{key}="{value:.10g}"' for key, value in zip(names, inertia))
    return f"""\
  <link name="{name}">
    <inertial>
      <origin xyz="{numbers(com)}"/>
      <mass value="{mass:.10g}"/>
      <inertia {attributes}/>
    </inertial>
  </link>
"""


def fixed(child, parent, xyz):
    return f"""\
  <joint name="{child}_joint" type="fixed">
    <origin xyz="{numbers(xyz)}"/>
    <parent link="{parent}"/>
    <child link="{child}"/>
  </joint>
"""


def revolute(child, parent, xyz, axis, limits):
    lower, upper, effort, velocity = limits
    return f"""\
  <joint name="{child}_joint" type="revolute">
    <origin xyz="{numbers(xyz)}"/>
    <parent link="{parent}"/>
    <child link="{child}"/>
    <axis xyz="{axis}"/>
    <limit lower="{lower}" upper="{upper}" effort="{effort}" velocity="{velocity}"/>
  </joint>
"""


def leg(name, s, f):
    side = flip_y if s < 0 else lambda body: body
    end = flip_x if f < 0 else lambda body: body
    hip, thigh, calf, foot = (f"{name}_{part}" for part in ("hip", "thigh", "calf", "foot"))
    return [
        link(hip, end(side(HIP))),
        link(thigh, side(THIGH)),
        link(calf, side(CALF)),
        link(foot, FOOT),
        link(f"{hip}_rotor", ROTOR_X),
        link(f"{thigh}_rotor", ROTOR_Y),
        link(f"{calf}_rotor", ROTOR_Y),
        revolute(hip, "base", (0.1934 * f, 0.0465 * s, 0), "1 0 0", HIP_LIMITS),
        revolute(thigh, hip, (0, 0.0955 * s, 0), "0 1 0", THIGH_LIMITS[f]),
        revolute(calf, thigh, (0, 0, -0.213), "0 1 0", CALF_LIMITS),
        fixed(foot, calf, (0, 0, -0.213)),
        # The rotors' mass rides on the link before the joint they drive.
        fixed(f"{hip}_rotor", "base", (0.11215 * f, 0.04675 * s, 0)),
        fixed(f"{thigh}_rotor", hip, (0, -0.00015 * s, 0)),
        fixed(f"{calf}_rotor", thigh, (0, -0.03235 * s, 0)),
    ]


def urdf():
    parts = [
        '<?xml version="1.0"?>\n',
        "<!-- Unitree Go2: kinematics, limits and inertia only. Written by go2_urdf.py. -->\n",
        '<robot name="go2">\n',
        link("base", BASE),
        link("Head_upper", HEAD),
        link("Head_lower", HEAD),
        fixed("Head_upper", "base", (0.285, 0, 0.01)),
        fixed("Head_lower", "base", (0.293, 0, -0.06)),
    ]
    for name, (s, f) in LEGS.items():
        parts += leg(name, s, f)
    parts.append("</robot>\n")
    return "".join(parts)
