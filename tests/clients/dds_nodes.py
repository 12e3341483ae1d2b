"""Nodes beside the bridge on an independent DDS, for check_dds.py: a costmap that hears where people will
be, a manager of the node, and Nav2's following server."""

import threading
import time
from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl import types as t


@dataclass
class Stamp(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: t.int32
    nanosec: t.uint32


@dataclass
class Head(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Stamp
    frame_id: str


@dataclass
class Place(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: t.float64
    y: t.float64
    z: t.float64


@dataclass
class Turn(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: t.float64
    y: t.float64
    z: t.float64
    w: t.float64


@dataclass
class Origin(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Place
    orientation: Turn


@dataclass
class MapMetaData(IdlStruct, typename="nav_msgs::msg::dds_::MapMetaData_"):
    map_load_time: Stamp
    resolution: t.float32
    width: t.uint32
    height: t.uint32
    origin: Origin


@dataclass
class OccupancyGrid(IdlStruct, typename="nav_msgs::msg::dds_::OccupancyGrid_"):
    header: Head
    info: MapMetaData
    data: t.sequence[t.int8]

    def at(self, x, y):
        column = int((x - self.info.origin.position.x) / self.info.resolution)
        row = int((y - self.info.origin.position.y) / self.info.resolution)
        return self.data[row * self.info.width + column]


# Managed nodes, with the caller's number before each request and answer.
@dataclass
class State(IdlStruct, typename="lifecycle_msgs::msg::dds_::State_"):
    id: t.uint8
    label: str


@dataclass
class Transition(IdlStruct, typename="lifecycle_msgs::msg::dds_::Transition_"):
    id: t.uint8
    label: str


@dataclass
class TransitionDescription(
    IdlStruct, typename="lifecycle_msgs::msg::dds_::TransitionDescription_"
):
    transition: Transition
    start_state: State
    goal_state: State


@dataclass
class TransitionEvent(IdlStruct, typename="lifecycle_msgs::msg::dds_::TransitionEvent_"):
    timestamp: t.uint64
    transition: Transition
    start_state: State
    goal_state: State


@dataclass
class GetStateRequest(IdlStruct, typename="lifecycle_msgs::srv::dds_::GetState_Request_"):
    guid: t.uint64
    number: t.int64
    structure_needs_at_least_one_member: t.uint8


@dataclass
class GetStateResponse(IdlStruct, typename="lifecycle_msgs::srv::dds_::GetState_Response_"):
    guid: t.uint64
    number: t.int64
    current_state: State


@dataclass
class ChangeStateRequest(IdlStruct, typename="lifecycle_msgs::srv::dds_::ChangeState_Request_"):
    guid: t.uint64
    number: t.int64
    transition: Transition


@dataclass
class ChangeStateResponse(IdlStruct, typename="lifecycle_msgs::srv::dds_::ChangeState_Response_"):
    guid: t.uint64
    number: t.int64
    success: bool


@dataclass
class TransitionsRequest(
    IdlStruct, typename="lifecycle_msgs::srv::dds_::GetAvailableTransitions_Request_"
):
    guid: t.uint64
    number: t.int64
    structure_needs_at_least_one_member: t.uint8


@dataclass
class TransitionsResponse(
    IdlStruct, typename="lifecycle_msgs::srv::dds_::GetAvailableTransitions_Response_"
):
    guid: t.uint64
    number: t.int64
    available_transitions: t.sequence[TransitionDescription]


# The action FollowObject of Nav2.
@dataclass
class Uuid(IdlStruct, typename="unique_identifier_msgs::msg::dds_::UUID_"):
    uuid: t.array[t.uint8, 16]


@dataclass
class Span(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    sec: t.int32
    nanosec: t.uint32


@dataclass
class Goal(IdlStruct, typename="nav2_msgs::action::dds_::FollowObject_Goal_"):
    pose_topic: str
    tracked_frame: str
    max_duration: Span


@dataclass
class Result(IdlStruct, typename="nav2_msgs::action::dds_::FollowObject_Result_"):
    total_elapsed_time: Span
    error_code: t.uint16
    num_retries: t.uint16
    error_msg: str


@dataclass
class Feedback(IdlStruct, typename="nav2_msgs::action::dds_::FollowObject_Feedback_"):
    state: t.uint16
    following_time: Span
    num_retries: t.uint16


@dataclass
class FeedbackMessage(IdlStruct, typename="nav2_msgs::action::dds_::FollowObject_FeedbackMessage_"):
    goal_id: Uuid
    feedback: Feedback


@dataclass
class SendGoalRequest(
    IdlStruct, typename="nav2_msgs::action::dds_::FollowObject_SendGoal_Request_"
):
    guid: t.uint64
    number: t.int64
    goal_id: Uuid
    goal: Goal


@dataclass
class SendGoalResponse(
    IdlStruct, typename="nav2_msgs::action::dds_::FollowObject_SendGoal_Response_"
):
    guid: t.uint64
    number: t.int64
    accepted: bool
    stamp: Stamp


@dataclass
class GetResultRequest(
    IdlStruct, typename="nav2_msgs::action::dds_::FollowObject_GetResult_Request_"
):
    guid: t.uint64
    number: t.int64
    goal_id: Uuid


@dataclass
class GetResultResponse(
    IdlStruct, typename="nav2_msgs::action::dds_::FollowObject_GetResult_Response_"
):
    guid: t.uint64
    number: t.int64
    status: t.int8
    result: Result


@dataclass
class GoalInfo(IdlStruct, typename="action_msgs::msg::dds_::GoalInfo_"):
    goal_id: Uuid
    stamp: Stamp


@dataclass
class CancelGoalRequest(IdlStruct, typename="action_msgs::srv::dds_::CancelGoal_Request_"):
    guid: t.uint64
    number: t.int64
    goal_info: GoalInfo


@dataclass
class CancelGoalResponse(IdlStruct, typename="action_msgs::srv::dds_::CancelGoal_Response_"):
    guid: t.uint64
    number: t.int64
    return_code: t.int8
    goals_canceling: t.sequence[GoalInfo]


CANCELED, ABORTED = 5, 6
FAILED_TO_DETECT_OBJECT = 902


class FollowingServer:
    """The following server, as rmw_cyclonedds carries actions: `reader` and `writer` create the ends of a
    topic."""

    def __init__(self, reader, writer):
        def service(name, request, response):
            base = f"follow_object/_action/{name}"
            return reader(f"rq/{base}Request", request), writer(f"rr/{base}Reply", response)

        self.goals = service("send_goal", SendGoalRequest, SendGoalResponse)
        self.cancels = service("cancel_goal", CancelGoalRequest, CancelGoalResponse)
        self.results = service("get_result", GetResultRequest, GetResultResponse)
        self.feedback = writer("rt/follow_object/_action/feedback", FeedbackMessage)
        # Topics of the goals, and times of the cancellations.
        self.asked, self.cancelled = [], []
        self.goal, self.waiting = None, None
        # `obeys`, `refuses`, `aborts` a goal, `is deaf` to cancellations, or `is silent`: no feedback.
        self.mode = "obeys"
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while True:
            self.take_goal()
            self.take_cancellation()
            for request in taken(self.results[0], GetResultRequest):
                self.waiting = request
            if self.mode == "aborts" and self.goal and self.waiting:
                self.end(ABORTED, FAILED_TO_DETECT_OBJECT, "no pose")
            if self.goal and self.mode != "is silent":
                self.feedback.write(FeedbackMessage(self.goal, Feedback(2, Span(1, 0), 0)))
            time.sleep(0.02)

    def take_goal(self):
        for request in taken(self.goals[0], SendGoalRequest):
            self.asked.append(request.goal.pose_topic)
            accepted = self.mode != "refuses"
            if accepted:
                self.goal = request.goal_id
            answer = SendGoalResponse(request.guid, request.number, accepted, Stamp(0, 0))
            self.goals[1].write(answer)

    def take_cancellation(self):
        if self.mode == "is deaf":
            return
        for request in taken(self.cancels[0], CancelGoalRequest):
            is_ours = self.goal and request.goal_info.goal_id.uuid == self.goal.uuid
            infos = [request.goal_info] if is_ours else []
            self.cancels[1].write(
                CancelGoalResponse(request.guid, request.number, 0 if is_ours else 2, infos)
            )
            if is_ours:
                self.cancelled.append(time.monotonic())
                self.end(CANCELED, 0, "")

    def end(self, status, code, message):
        """Ends the goal, with its result for whoever waits for it."""
        self.goal = None
        if self.waiting:
            guid, number = self.waiting.guid, self.waiting.number
            result = Result(Span(1, 0), code, 0, message)
            self.results[1].write(GetResultResponse(guid, number, status, result))
            self.waiting = None


def taken(reader, kind):
    return [message for message in reader.take(16) if isinstance(message, kind)]
