//! What a thread has compiled of the projects that it runs.

use std::cell::RefCell;
use std::sync::Arc;

use nsdc::expr::Exprs;
use nsdc::session::Session;
use nsdc::watch::Watch;
use nsdc::{Messages, Options, Project, Run};
use self_cell::self_cell;

/// Projects of which a thread keeps what it has compiled.
const MOST: usize = 8;
/// Expressions of a project with which it is compiled anew: those of what is not kept any more are among them.
const MOST_NODES: usize = 4_000_000;

struct Owner {
    exprs: Exprs,
    project: Arc<Project>,
}

self_cell!(
    struct Compiled {
        owner: Owner,
        #[not_covariant]
        dependent: Session,
    }
);

thread_local! {
    /// The one that was used last is last.
    static COMPILED: RefCell<Vec<Compiled>> = const { RefCell::new(Vec::new()) };
}

/// Runs an experiment of a project, and keeps what it is compiled to for other runs on this thread.
///
/// # Errors
///
/// Those of [`Project::run`].
pub fn run(
    project: &Arc<Project>,
    experiment: &str,
    options: &Options,
    watch: &mut dyn Watch,
) -> Result<Run, Messages> {
    // It is not there while it runs: handlers of signals may run other experiments.
    let mut compiled = taken(project);
    let found = compiled.with_dependent_mut(|_, session| session.run(experiment, options, watch));
    if compiled.borrow_owner().exprs.n_nodes() < MOST_NODES {
        COMPILED.with_borrow_mut(|all| {
            all.push(compiled);
            if all.len() > MOST {
                all.remove(0);
            }
        });
    }
    found
}

fn taken(project: &Arc<Project>) -> Compiled {
    let known = COMPILED.with_borrow_mut(|all| {
        let is_it = |known: &Compiled| Arc::ptr_eq(&known.borrow_owner().project, project);
        let place = all.iter().rposition(is_it)?;
        Some(all.remove(place))
    });
    known.unwrap_or_else(|| {
        let owner = Owner {
            exprs: Exprs::new(),
            project: project.clone(),
        };
        Compiled::new(owner, |owner| Session::new(&owner.exprs, &owner.project))
    })
}
