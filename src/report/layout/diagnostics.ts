// Whether the IMU rests, the faces seen, and what is known of it, for Diagnostics panels: what tail --live serves as
// /diagnostics, derived from what a recording holds. Made by stillpoint config layout.
import { Input, Message } from "./types";

export const inputs = ["STILLNESS_TOPIC", "COVERAGE_TOPIC", "CALIBRATION_TOPIC"];
export const output = "/studio_script/diagnosticsPLACE";

type Vector = { x: number; y: number; z: number };
type Values = [string, string][];

const OK = 0;
const WARN = 1;

// The last word on each.
let rest = { level: WARN, message: "not judged yet" };
let restValues: Values = [];
let faces = { level: WARN, message: "none seen yet" };
let faceValues: Values = [];
let next = "no calibration yet";
let status = 0;
let calibrationValues: Values = [];

const number = (value: number, digits: number) => value.toFixed(digits).replace("-", "−");

// Three numbers with half of their 95 % interval; nothing where they are absent.
const vector = (key: string, value?: Vector, std?: Vector, digits = 4): Values => {
  if (!value || !Number.isFinite(value.x)) {
    return [];
  }
  const axis = (v: number, s?: number) => number(v, digits) + (s && s > 0 ? ` ± ${number(1.96 * s, digits)}` : "");
  return (["x", "y", "z"] as const).map((a) => [`${key}, ${a}`, axis(value[a], std ? std[a] : undefined)]);
};

const item = (name: string, level: number, message: string, values: Values) => ({
  level,
  name,
  message,
  hardware_id: "IMU",
  values: values.map(([key, value]) => ({ key, value })),
});

export default function script(
  event:
    | Input<"STILLNESS_TOPIC">
    | Input<"COVERAGE_TOPIC">
    | Input<"CALIBRATION_TOPIC">,
): Message<"diagnostic_msgs/DiagnosticArray"> {
  const message = event.message as any;
  if (event.topic === "STILLNESS_TOPIC") {
    rest = [
      { level: WARN, message: "its noise is not known yet: let it rest" },
      { level: OK, message: "moving" },
      { level: OK, message: "still" },
    ][message.state as number] ?? rest;
    restValues = [
      ["deviation over the noise floor", number(message.statistic, 2)],
      ["still below", number(message.enter, 2)],
    ];
  } else if (event.topic === "COVERAGE_TOPIC") {
    const seen = (message.faces as any[]).filter((face) => face.placements > 0).length;
    faces = { level: message.complete ? OK : WARN, message: `${seen} of ${message.faces.length} seen` };
    faceValues = (message.faces as any[]).map((face) => [
      face.name,
      face.placements > 0 ? `${face.placements}×, ${number(face.seconds, 1)} s` : "missing",
    ]);
    next = message.next_step;
  } else {
    const triad = message.accelerometer;
    status = triad?.status ?? 0;
    const rests = Number(message.segments) === 1 ? "rest" : "rests";
    calibrationValues = [
      ["revision", `${message.revision}, from ${message.segments} ${rests}`],
      ...vector("bias, m/s²", triad?.bias, triad?.bias_std),
      ...vector("scale", triad?.scale, triad?.scale_std),
      ...vector("bias, rad/s", message.gyroscope?.bias, message.gyroscope?.bias_std, 5),
    ];
  }
  const known = ["", "provisional: ", "confirmed: "][status] ?? "";
  return {
    header: { stamp: event.receiveTime, frame_id: "" },
    status: [
      item("rest", rest.level, rest.message, restValues),
      item("faces", faces.level, faces.message, faceValues),
      item("calibration", status === 2 ? OK : WARN, known + next, calibrationValues),
    ],
  } as any;
}
