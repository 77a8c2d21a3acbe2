//! Commands over every experiment.

use lsp_types::{CodeLens, CodeLensParams, Command};
use serde_json::json;

use super::Answer;
use super::world::World;

/// What can be done with an experiment; each is `nsdc.` and this word.
pub const WORDS: [&str; 5] = ["run", "plot", "test", "verify", "emit"];

/// The names of the commands.
pub fn commands() -> Vec<String> {
    WORDS.map(|word| format!("nsdc.{word}")).to_vec()
}

/// All of them, at the name of each experiment; their arguments are the file and the name.
pub fn all(world: &mut World, params: &CodeLensParams) -> Answer<Option<Vec<CodeLens>>> {
    let uri = &params.text_document.uri;
    let Some(analysis) = world.analysis(uri) else {
        return Ok(None);
    };
    let of_experiment = |experiment: &crate::syntax::Experiment| {
        let range = analysis.range(experiment.name.span);
        let name = experiment.name.name.clone();
        WORDS.map(|word| CodeLens {
            range,
            command: Some(Command {
                title: word.to_owned(),
                command: format!("nsdc.{word}"),
                arguments: Some(vec![json!(uri), json!(name)]),
            }),
            data: None,
        })
    };
    Ok(Some(
        analysis
            .project
            .experiments()
            .flat_map(of_experiment)
            .collect(),
    ))
}
