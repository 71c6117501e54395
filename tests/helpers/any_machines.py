"""Machines with what a plain station has not: weight, geoms, turned bodies, tendons, servos."""

GANTRY = """<mujoco model="gantry">
  <compiler angle="degree"/>
  <default>
    <geom contype="0" conaffinity="0" density="2700"/>
    <joint damping="60"/>
    <default class="stiff"><joint type="slide" stiffness="4e6" damping="900"/></default>
  </default>
  <worldbody>
    <site name="floor" pos="0 0 0"/>
    <body name="bridge" pos="0 0 0.6" euler="0 0 20">
      <geom type="box" size="0.5 0.06 0.05"/>
      <joint name="bridge_tx" class="stiff" axis="1 0 0"/>
      <joint name="bridge_tz" class="stiff" axis="0 0 1"/>
      <joint name="bridge_rx" type="hinge" axis="1 0 0" stiffness="2e5"/>
      <joint name="bridge_rz" type="hinge" axis="0 0 1" stiffness="3e5"/>
      <site name="acc1" pos="0.45 0.05 0.05" euler="10 0 30"/>
      <site name="acc2" pos="-0.45 0.05 0.05"/>
      <site name="acc3" pos="0.1 -0.06 -0.05"/>
      <site name="hit9" pos="0.3 -0.06 0" euler="0 25 0"/>
      <body name="plate" pos="0.1 0 0.08"><geom type="cylinder" size="0.05 0.02"/></body>
      <body name="carriage" pos="0.1 0 -0.2" euler="0 15 0">
        <geom type="box" size="0.08 0.07 0.12"/>
        <joint name="carriage_ty" class="stiff" axis="0 1 0" stiffness="1e6"/>
        <joint name="carriage_ry" type="hinge" axis="0 1 0" pos="0 0 0.12" stiffness="5e4"/>
        <joint name="carriage_rz" type="hinge" axis="0 0 1" stiffness="4e4"/>
        <site name="acc4" pos="0.08 0.07 0"/>
        <site name="acc5" pos="-0.08 -0.07 0.1"/>
        <site name="acc6" pos="0 0.07 -0.1"/>
        <body name="pendulum" pos="0 0 -0.15">
          <geom type="capsule" size="0.03" fromto="0 0 0 0 0 -0.25"/>
          <joint name="swing" type="hinge" axis="1 0 0" damping="0.02"/>
          <site name="acc7" pos="0 0.03 -0.2"/>
          <site name="acc8" pos="0.03 0 -0.1"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

SERVO_AXIS = """<mujoco model="servo axis">
  <compiler angle="radian"/>
  <worldbody>
    <body name="frame" pos="0 0 0.3">
      <inertial pos="0 0 0" mass="120" diaginertia="4 6 8"/>
      <joint name="frame_tx" type="slide" axis="1 0 0" stiffness="8e6" damping="2e3"/>
      <joint name="frame_tz" type="slide" axis="0 0 1" stiffness="9e6" damping="2e3"/>
      <joint name="frame_ry" type="hinge" axis="0 1 0" stiffness="2e6" damping="300"/>
      <site name="acc1" pos="0.2 0.1 0.1"/><site name="acc2" pos="-0.2 -0.1 0"/>
      <site name="acc3" pos="0.2 -0.1 0.1"/><site name="hook_a" pos="-0.2 0 0.1"/>
      <body name="slide" pos="0.05 0 0.15">
        <inertial pos="0 0 0.02" mass="25" diaginertia="0.3 0.4 0.5"/>
        <joint name="drive" type="slide" axis="1 0 0" damping="40" armature="6"/>
        <joint name="slide_rz" type="hinge" axis="0 0 1" stiffness="1.5e5" damping="30"/>
        <site name="acc4" pos="0.1 0.1 0"/><site name="acc5" pos="-0.1 -0.1 0.1"/>
        <site name="acc6" pos="0.1 -0.1 0.05"/><site name="hook_b" pos="-0.1 0.02 0.05"/>
        <site name="hit6" pos="0.1 -0.1 0.05"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="hose" stiffness="3e4" damping="20" springlength="0.1">
      <site site="hook_a"/><site site="hook_b"/>
    </spatial>
    <fixed name="coupling" stiffness="2e5" damping="15">
      <joint joint="frame_ry" coef="0.3"/><joint joint="slide_rz" coef="1"/>
    </fixed>
  </tendon>
  <actuator><position name="servo" joint="drive" kp="2e6" kv="1.5e3"/></actuator>
</mujoco>
"""
