"""my_system: an arm from a URDF taps the table with its hand, and comes back to rest.

`python my_system.py` solves the problem, prints the result and draws my_system.png;
`dmoc solve my_system.py:problem --out result` does the same on the command line;
`dmoc derive my_system.py:system` shows the equations, `dmoc models my_system.urdf` the robot.
"""

from pathlib import Path

import dmoc

# The robot: name your own file here, and leave ARM out.
FILE = Path(__file__).with_name("my_system.urdf")
INERTIAL = """<inertial><origin xyz="0 0 0.2"/><mass value="1.5"/>
      <inertia ixx="0.02" iyy="0.02" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>"""
ARM = f"""<robot name="my_system">
  <link name="stand"/>
  <link name="upper">{INERTIAL}</link>
  <link name="lower">{INERTIAL}</link>
  <link name="hand">
    <collision name="hand"><geometry><sphere radius="0.05"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="stand"/><child link="upper"/><origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="60" velocity="8"/><dynamics damping="0.1"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="lower"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="2.5" effort="40" velocity="8"/><dynamics damping="0.1"/>
  </joint>
  <joint name="wrist" type="fixed">
    <parent link="lower"/><child link="hand"/><origin xyz="0 0 0.4"/>
  </joint>
</robot>
"""
if not FILE.exists():
    FILE.write_text(ARM)

robot = dmoc.read_robot(FILE)  # base="quaternion" lets its root float
table = robot.gaps(["hand"])  # distances from the plane z = 0; place and normal are arguments

system = robot.system(
    "my_system",
    surfaces={name: gap >= 0 for name, gap in table.items()},
    # Torques have the names of the joints with u_ before them.
    cost=sum(u**2 for u in robot.inputs.values()),
)


def problem() -> dmoc.Problem:
    """State what the motion shall do: tap the table, and be back after a second."""
    home = {"shoulder": 0.4, "elbow": 1.4}
    return dmoc.Problem(
        system,
        start=home,  # at rest unless "shoulder_dot" is given
        goal={**home, "shoulder_dot": 0.0, "elbow_dot": 0.0},  # what is not named is free
        sequence=["hand"],  # the collisions in their order
        final_time=1.0,  # a pair (shortest, longest) leaves it free
        bounds=robot.bounds,  # of the joints, their velocities and torques
        restitution=0.5,
    )


def main() -> None:
    """Solve the problem, check the motion by simulation, print and draw it."""
    print(robot)
    solution = dmoc.solve(problem())
    print(solution)
    solution.save("my_system.npz")
    solution.plot("my_system.png")


if __name__ == "__main__":
    main()
