// Written by tools/page_types.py from page_types.py, which explains all fields.

export type Column = Array<number | null>;
export type IntColumn = Array<number>;
export interface PageData {
  title: string;
  notes: string;
  engine_notes: Array<string>;
  experiments: Array<PageExperiment>;
}
export interface PageExperiment {
  id: string;
  headline: string;
  grounds: string;
  remarks: Array<string>;
  next: NextSteps;
  ranges: Array<string>;
  leader: number | null;
  recommended: number | null;
  thresholds: Array<number>;
  judged: boolean;
  simulation: string;
  interval: string;
  environments: number;
  time_limit_s: number;
  parameters: Array<VariedParameter>;
  fixed: Array<Array<string>>;
  designs: DesignTable;
  exported: ExportedColumns;
  engines: Array<OtherSimulation>;
  realities: PageRealities | null;
  effects: Array<ParameterEffect>;
  importance: Array<ParameterImportance>;
  causes: Array<Cause>;
  ends: RunEnds | null;
  runs: RunTable | null;
  runs_omitted: string;
  outcomes: Array<string>;
  outcome_labels: Array<string>;
  drives: Drives | null;
  trials: Array<TrialRow>;
  front: SearchFront | null;
  provenance: Array<Array<string>>;
  files: Array<Array<string>>;
}
export interface NextSteps {
  text: string;
  steps: Array<NextStep>;
}
export interface NextStep {
  text: string;
  design: number | null;
  gain: number;
  minutes: number;
}
export interface VariedParameter {
  name: string;
  label: string;
  unit: string;
  values: Array<number>;
}
export interface DesignTable {
  value: Array<Array<number>>;
  name: Array<string>;
  swept: Array<boolean>;
  runs: IntColumn;
  passed: IntColumn;
  rate: Column;
  low: Column;
  high: Column;
  outcomes: Array<IntColumn>;
  trials: IntColumn;
  trials_passed: IntColumn;
  cars: IntColumn;
  trials_low: Column;
  trials_high: Column;
  belief: Column;
  belief_low: Column;
  belief_high: Column;
  verdict: Array<"good" | "bad" | "open" | null>;
  refuted: Array<string | null>;
  measures: Array<Measure>;
}
export interface Measure {
  key: string;
  label: string;
  unit: string;
  better: "less" | "more" | null;
  value: Column;
}
export interface ExportedColumns {
  vehicle: string;
  environment: string;
  parameters: Array<string>;
  fixed: Record<string, number>;
}
export interface OtherSimulation {
  id: string;
  name: string;
  passed: IntColumn;
  runs: IntColumn;
  text: string;
}
export interface PageRealities {
  driven: boolean;
  names: Array<string>;
  values: Array<Array<number>>;
  rates: Array<Column>;
  unknowns: Array<TaughtUnknown>;
  taught: Array<string>;
  learned: LearnedRate;
}
export interface TaughtUnknown {
  name: string;
  unit: string;
  meaning: string;
  before: Array<number>;
  after: Array<number>;
  measured: number | null;
  taught: boolean;
}
export interface LearnedRate {
  runs: number;
  error: number | null;
}
export interface ParameterEffect {
  parameter: number;
  grid: Array<number>;
  mean: Array<number>;
  low: Array<number>;
  high: Array<number>;
  level: Array<number>;
  curves: Array<Array<number>>;
  over: string;
}
export interface ParameterImportance {
  parameter: number;
  share: number;
  low: number;
  high: number;
}
export interface Cause {
  name: string;
  label: string;
  unit: string;
  separation: number;
  low: number;
  high: number;
  rises: boolean;
  bins: Array<CauseBin>;
}
export interface CauseBin {
  from: number;
  to: number;
  runs: number;
  passed: number;
}
export interface RunEnds {
  from_m: number;
  step_m: number;
  bins: number;
  goal_m: number;
  obstacles: Array<ObstacleRange>;
  design: Array<number>;
  outcome: Array<number>;
  bin: Array<number>;
  obstacle: Array<number>;
  count: Array<number>;
}
export interface ObstacleRange {
  name: string;
  from_m: number;
  to_m: number;
  least_m: number;
  most_m: number;
}
export interface RunTable {
  design: Array<number>;
  environment: Array<number>;
  outcome: Array<number>;
  time_s: Column;
}
export interface Drives {
  key: string;
  engine: string;
  build: string;
  designs: Array<number>;
  environments: Array<number>;
  path_interval_s: number;
  sliders: Array<Slider>;
}
export interface Slider {
  name: string;
  unit: string;
  meaning: string;
  nominal: number;
  low: number;
  high: number;
}
export interface TrialRow {
  number: number;
  design: number | null;
  car: string;
  car_name: string | null;
  standing: string;
  environment: number | null;
  passed: boolean | null;
  outcome: string;
  time_s: number | null;
  when: string | null;
  note: string;
  media: Array<MediaFile>;
  replay: TrialReplay | null;
}
export interface MediaFile {
  kind: string;
  name: string;
  address: string | null;
}
export interface TrialReplay {
  moved: number;
  path: boolean;
  attitude: Array<Array<number>> | null;
  missing: string | null;
}
export interface SearchFront {
  objectives: Array<PageObjective>;
  points: Array<FrontPoint>;
}
export interface PageObjective {
  label: string;
  unit: string;
  better: "less" | "more";
}
export interface FrontPoint {
  design: number;
  values: Column;
  low: Column;
  high: Column;
  fresh: boolean;
  beaten: boolean;
}
