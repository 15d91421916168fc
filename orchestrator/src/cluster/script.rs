//! The script that is submitted: short, for people to read, and kept.

use super::folder::Exchange;
use super::intent::Intent;
use super::needs::clock;
use plyflow_model::profile::Profile;

/// A word of a shell script.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', r"'\''"))
}

/// The text of the script of a submission. `program`: this program, absolute.
pub fn text(intent: &Intent, profile: &Profile, program: &str, exchange: &Exchange) -> String {
    let shape = &intent.shape;
    let folder = exchange.submission(&intent.name);
    let mut options = vec![format!("--job-name={}", intent.name)];
    // `%` begins what Slurm fills in.
    let log = folder.as_str().replace('%', "%%");
    if intent.size > 1 {
        options.push(format!("--array=0-{}", intent.size - 1));
        options.push(format!("--output=\"{log}/log-%a\""));
    } else {
        options.push(format!("--output=\"{log}/log-0\""));
    }
    for (key, value) in [
        ("partition", &profile.partition),
        ("account", &profile.account),
        ("qos", &profile.qos),
    ] {
        options.extend(value.as_ref().map(|v| format!("--{key}={v}")));
    }
    options.push("--nodes=1 --ntasks=1".into());
    options.push(format!("--cpus-per-task={}", shape.all_cores()));
    options.push(format!("--mem={}M", shape.all_memory()));
    options.push(format!("--time={}", clock(shape.walltime)));
    if shape.gpus > 0 {
        options.push(format!("--gres=gpu:{}", shape.gpus));
    }
    if !shape.without.is_empty() {
        options.push(format!("--exclude={}", shape.without.join(",")));
    }
    options.push(format!("--signal=B:TERM@{}", intent.grace.ceil()));
    options.push("--no-requeue --open-mode=append".into());
    options.extend(profile.options.iter().cloned());
    let mut script = "#!/bin/bash\n".to_owned();
    for option in &options {
        script += &format!("#SBATCH {option}\n");
    }
    for line in &profile.setup {
        script += &format!("{line}\n");
    }
    let index = match intent.size {
        1 => "0",
        _ => "\"$SLURM_ARRAY_TASK_ID\"",
    };
    // In the shell's place, so that Slurm's signal reaches it.
    script += &format!(
        "exec {} pilot {} {} {index}\n",
        quoted(program),
        quoted(exchange.root().as_str()),
        quoted(&intent.name)
    );
    script
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::needs::Shape;

    #[test]
    fn the_script_asks_for_the_shape_and_puts_the_program_in_its_place() {
        let shape = Shape {
            cores: 2,
            memory: 100,
            walltime: 3600,
            gpus: 1,
            at_once: 1,
            without: vec!["n3".into()],
        };
        let intent = Intent {
            name: "plyflow-a-1".into(),
            shape,
            size: 3,
            most_steps: 10,
            grace: 90.0,
            idle: 5.0,
        };
        let profile = Profile {
            partition: Some("gpu".into()),
            setup: vec!["module load x".into()],
            options: vec!["--constraint=a100".into()],
            ..Profile::default()
        };
        let exchange = Exchange::at("/store/it's 5%/cluster".into());
        let script = text(&intent, &profile, "/opt/ply flow", &exchange);
        for line in [
            "#SBATCH --job-name=plyflow-a-1",
            "#SBATCH --array=0-2",
            "#SBATCH --output=\"/store/it's 5%%/cluster/submissions/plyflow-a-1/log-%a\"",
            "#SBATCH --partition=gpu",
            "#SBATCH --cpus-per-task=2",
            "#SBATCH --mem=164M",
            "#SBATCH --time=0-01:00:00",
            "#SBATCH --gres=gpu:1",
            "#SBATCH --exclude=n3",
            "#SBATCH --signal=B:TERM@90",
            "#SBATCH --constraint=a100",
            "module load x",
            r#"exec '/opt/ply flow' pilot '/store/it'\''s 5%/cluster' 'plyflow-a-1' "$SLURM_ARRAY_TASK_ID""#,
        ] {
            assert!(script.lines().any(|l| l == line), "{line}\n{script}");
        }
    }
}
