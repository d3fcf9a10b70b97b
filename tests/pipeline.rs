//! The pipeline as a library meets it: the same design as the program makes,
//! progress that adds up, and work that stops when it is told to.

#[path = "common/program.rs"]
mod program;

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use coaxdesign::linear::io::set_to_json;
use coaxdesign::pipeline::{
    FlightPlan, Observer, PipelineError, Requirements, Silent, Task, TuneOptions, fly, models,
    trim, tune, verify,
};
use coaxdesign::problem;
use coaxdesign::schedule::Schedule;
use coaxdesign::simulate::{Status, maneuver};
use coaxdesign::trim::FlightCondition;
use coaxdesign::units::{KNOT, System};
use program::{code, command, err, out};

/// Two speeds and an axis: a design in seconds, with a speed between the two at
/// which it is tuned and verified too.
const SPECIFICATION: &str = "[schedule]\nspeeds = [\"60 kt\", \"64 kt\"]\n\
    [margins.nominal]\ngain_margin_db = 6.0\nphase_margin = \"45 deg\"\n\
    [axis.roll]\ndrb = \"0.6 rad/s\"\ndrp_db = 5.0\ncrossover_min = \"1.5 rad/s\"\n";

/// Notes tasks and steps; stops once so many steps are done.
#[derive(Default)]
struct Counter {
    tasks: Mutex<Vec<(Task, u64)>>,
    open: AtomicU64,
    steps: AtomicU64,
    stop_after: Option<u64>,
}

impl Observer for Counter {
    fn begin(&self, task: Task, steps: u64) {
        self.tasks.lock().unwrap().push((task, steps));
        assert_eq!(self.open.fetch_add(1, Ordering::SeqCst), 0, "tasks overlap");
    }

    fn advance(&self) {
        self.steps.fetch_add(1, Ordering::SeqCst);
    }

    fn end(&self) {
        self.open.fetch_sub(1, Ordering::SeqCst);
    }

    fn cancelled(&self) -> bool {
        self.stop_after.is_some_and(|most| self.steps.load(Ordering::SeqCst) >= most)
    }
}

#[test]
fn the_library_makes_the_bytes_of_the_program() {
    let home = tempfile::tempdir().unwrap();
    let d = home.path();
    std::fs::write(d.join("spec.toml"), SPECIFICATION).unwrap();
    let made = command(d, "tune-gains --spec spec.toml -o made --quiet");
    assert_eq!(code(&made), 0, "{}", err(&made));

    let aircraft = problem::builtin().unwrap();
    let requirements = Requirements::load(&d.join("spec.toml")).unwrap();
    let counter = Counter::default();
    let tuned = tune(&aircraft, &requirements, &TuneOptions::default(), &counter).unwrap();
    let kept = |name: &str| std::fs::read_to_string(d.join("made").join(name)).unwrap();
    assert_eq!(tuned.schedule.to_json().unwrap(), kept("schedule.json"));
    let document = serde_json::to_string_pretty(&tuned.verification_document().unwrap()).unwrap();
    assert_eq!(document + "\n", kept("verification.json"));
    // Between the breakpoints too, which a naive sequence of calls would miss.
    let rows = &tuned.verified.verification.rows;
    assert!(rows.iter().any(|row| !row.breakpoint && (row.speed_m_s / KNOT - 62.0).abs() < 1e-9));

    // Three speeds of one model, then one step each; every task ended.
    let tasks = counter.tasks.lock().unwrap().clone();
    assert_eq!(tasks, [(Task::Models, 3), (Task::Tuning, 1), (Task::Verification, 1)]);
    assert_eq!(counter.open.load(Ordering::SeqCst), 0);
    assert_eq!(counter.steps.load(Ordering::SeqCst), 3);

    // The same judgement of the schedule as it stands.
    let problem = &aircraft.problem;
    let again = verify(&tuned.schedule, problem, &requirements.specification, &Silent).unwrap();
    assert_eq!(again.verification.rows, *rows);
    assert_eq!(again.authority, tuned.verified.authority);
}

#[test]
fn an_observer_stops_the_work_and_every_task_has_an_end() {
    let aircraft = problem::builtin().unwrap();
    let requirements = Requirements::parse("spec.toml", SPECIFICATION).unwrap();
    let counter = Counter { stop_after: Some(1), ..Counter::default() };
    let stopped = tune(&aircraft, &requirements, &TuneOptions::default(), &counter);
    assert!(matches!(stopped, Err(PipelineError::Cancelled)), "{:?}", stopped.map(|_| ()));
    assert_eq!(counter.open.load(Ordering::SeqCst), 0);
    assert_eq!(counter.tasks.lock().unwrap().len(), 1, "the tuning was begun all the same");

    let conditions = [FlightCondition::level(0.0)];
    let counter = Counter { stop_after: Some(0), ..Counter::default() };
    let stopped = trim(&aircraft.problem, &conditions, &[true], &counter);
    assert!(matches!(stopped, Err(PipelineError::Cancelled)));
    assert!(counter.tasks.lock().unwrap().is_empty());
}

#[test]
fn models_are_those_of_linearize() {
    let home = tempfile::tempdir().unwrap();
    let line = "linearize --speeds 0,20kt --interactions on --reduce residualize \
                --format json --units si --quiet";
    let told = command(home.path(), line);
    assert_eq!(code(&told), 0, "{}", err(&told));
    let problem = problem::builtin().unwrap().problem;
    let sets = models(&problem, &[0.0, 20.0 * KNOT], &[true], &Silent).unwrap();
    assert_eq!(set_to_json(&sets[0], System::Si), out(&told));
}

#[test]
fn a_flight_gives_every_row_and_stops_when_told() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("designs/coax2d/schedule.json");
    let schedule = Schedule::from_json(&std::fs::read_to_string(path).unwrap()).unwrap();
    let text = "title = \"Hover\"\nduration = \"2 s\"\nmode = \"velocity\"\n";
    let hover = maneuver::parse("hover.toml", text).unwrap();
    let problem = problem::builtin().unwrap().problem;
    let mut plan = FlightPlan::new(hover, Some(&schedule)).unwrap();
    plan.every = 10;
    let mut times: Vec<f64> = Vec::new();
    let flown = fly::<PipelineError>(&problem, Some(&schedule), &plan, &Silent, |columns, row| {
        assert_eq!(columns[0].name, "time");
        times.extend(row.first());
        Ok(())
    })
    .unwrap();
    assert_eq!(flown.status, Status::Completed);
    // 2 s at 100 Hz, every tenth period, both ends.
    assert_eq!(times.len(), 21);
    assert!(times.windows(2).all(|w| (w[1] - w[0] - 0.1).abs() < 1e-9));

    let counter = Counter { stop_after: Some(1), ..Counter::default() };
    let stopped = fly(&problem, Some(&schedule), &plan, &counter, |_, _| Ok(()));
    assert!(matches!(stopped, Err(PipelineError::Cancelled)));
    let open = fly(&problem, None, &plan, &Silent, |_, _| Ok(()));
    assert!(matches!(open, Err(PipelineError::Flight(_))), "a law is needed");
}
